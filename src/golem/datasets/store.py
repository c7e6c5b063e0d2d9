"""Reads a data set in LeRobot's format v3.0, of ours or of others."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.datasets import schema
from golem.datasets.schema import ABOUT, DATA, EPISODES, INFO, TASKS, VERSION, DatasetError, extra, read_features

DAMAGE = (ArithmeticError, AttributeError, LookupError, OSError, StopIteration, TypeError, ValueError)
"""What comes of metadata that says what it cannot."""


@dataclass(frozen=True, slots=True)
class RecordedEpisode:
    """One episode: its number, how many frames it has, what was done, and all that meta/episodes says of it."""

    index: int
    length: int
    tasks: list[str]
    row: Mapping[str, Any]

    def data_file(self, path: str) -> str:
        """Return its file of data by the pattern of info.json."""
        return path.format(chunk_index=self.row["data/chunk_index"], file_index=self.row["data/file_index"])

    def video_file(self, path: str, key: str) -> str:
        """Return its file of one video."""
        at = {name: self.row[f"videos/{key}/{name}"] for name in ("chunk_index", "file_index")}
        return path.format(video_key=key, **at)

    def statistics(self) -> dict[str, dict[str, Any]]:
        """Return its statistics by feature."""
        out: dict[str, dict[str, Any]] = {}
        for name, value in self.row.items():
            if name.startswith("stats/") and value is not None:
                feature, _, which = name.removeprefix("stats/").rpartition("/")
                out.setdefault(feature, {})[which] = value
        return out


class DatasetFolder:
    """A data set, open for reading.

    Attributes:
        info, about: what info.json and golem.json say; the second is empty in a data set of others.
        features: by name; `videos` are those that are in videos.
        labels: of the masks, whose numbers are their places here from 1 on.
        tasks, episodes: in their order.
    """

    def __init__(self, root: Path) -> None:
        """Read the metadata of the data set in `root`.

        Raises:
            DatasetError: there is none, it is of another version, empty, or its metadata is damaged.
            MissingExtra: the extra `data` is not installed.
        """
        pq, self.root, self.info = extra("pyarrow.parquet"), root, _read_json(root, INFO)
        version, arrow = self.info.get("codebase_version"), extra("pyarrow").ArrowException
        if version != VERSION:
            raise DatasetError(
                f"The data set {root} is of LeRobot's version {version}, not {VERSION}; `python -m "
                "lerobot.datasets.v30.convert_dataset_v21_to_v30` of the package lerobot converts one of v2.1."
            )
        try:
            self.features, self.fps = read_features(self.info), int(self.info["fps"])
            if self.fps < 1:
                raise ValueError(f"its fps are {self.fps}")
            self.info["data_path"] = self.info.get("data_path") or DATA
            self.videos = [name for name, feature in self.features.items() if feature.is_video]
            files = sorted((root / EPISODES).glob("*/*.parquet"))
            rows = sorted((r for f in files for r in pq.read_table(f).to_pylist()), key=lambda r: r["episode_index"])
            self.episodes = [
                RecordedEpisode(int(r["episode_index"]), int(r["length"]), list(r["tasks"]), r) for r in rows
            ]
            tasks = pq.read_table(root / TASKS).to_pydict()
            words = next(v for k, v in tasks.items() if k != "task_index")
            self.tasks = [words[tasks["task_index"].index(k)] for k in range(len(words))]
            for episode in self.episodes:
                episode.data_file(self.info["data_path"])
                for name in self.videos:
                    float(episode.row[f"videos/{name}/from_timestamp"])
                    episode.video_file(self.info["video_path"], name)
        except (*DAMAGE, arrow) as error:
            raise DatasetError(f"The metadata of the data set {root} is damaged: {error!r}.") from error
        self.about = _read_json(root, ABOUT) if (root / ABOUT).exists() else {}
        self.labels: list[Any] = self.about.get("masks") or []
        found, said = len(self.episodes), self.info.get("total_episodes")
        frames, told = sum(episode.length for episode in self.episodes), self.info.get("total_frames")
        if not frames:
            raise DatasetError(f"The data set {root} has no frames; record an episode first.")
        if (found, frames) != (said, told):
            raise DatasetError(
                f"The data set {root} has {found} episodes of {frames} frames, and info.json says {said} of {told}: "
                "a writer was ended halfway."
            )

    def require(self, *names: str, like: Mapping[str, Sequence[str]] | None = None) -> None:
        """Check that it has features, vectors with the names that `like` gives for them.

        Raises DatasetError: it has not: it is of another robot, or recorded without them.
        """
        for name in names:
            if name not in self.features:
                raise DatasetError(f"The data set {self.root} has no {name}; it has {', '.join(self.features)}.")
            wanted = (like or {}).get(name)
            if wanted is not None and list(self.features[name].names or ()) != list(wanted):
                robot, size = self.info.get("robot_type"), self.features[name].shape
                raise DatasetError(
                    f"The data set {self.root} is of another robot, '{robot}': its {name} {size} has other names than "
                    f"the {len(wanted)} of this one."
                )

    def episode(self, index: int) -> RecordedEpisode:
        """Return one episode. Raises DatasetError: there is none of that number."""
        if not 0 <= index < len(self.episodes):
            raise DatasetError(f"The data set {self.root} has episodes 0 to {len(self.episodes) - 1}, no {index}.")
        return self.episodes[index]

    def table(self, episode: RecordedEpisode, columns: Sequence[str] | None = None) -> Any:
        """Return the frames of an episode as an Arrow table. Raises DatasetError: its file is missing or damaged."""
        path, only = self.root / episode.data_file(self.info["data_path"]), episode.index
        try:
            table = extra("pyarrow.parquet").read_table(
                path, columns=None if columns is None else list(columns), filters=[("episode_index", "=", only)]
            )
        except (OSError, ValueError, extra("pyarrow").ArrowException) as error:
            why = str(error).partition("\n")[0]
            raise DatasetError(f"The frames of episode {only} cannot be read from {path}: {why}.") from error
        if table.num_rows != episode.length:
            raise DatasetError(f"{path} has {table.num_rows} frames of episode {only}, not {episode.length}.")
        if absent := [name for name in columns or schema.INDICES if name not in table.column_names]:
            raise DatasetError(f"{path} has no {absent[0]}; it has {', '.join(table.column_names)}.")
        return table

    def values(self, episode: RecordedEpisode, name: str) -> NDArray[Any]:
        """Return the values (n, ...) of one feature of an episode that is in no video; errors as for `table`."""
        column = self.table(episode, [name, "episode_index"])[name].combine_chunks()
        while hasattr(column.type, "value_type"):
            column = column.flatten()
        shape = self.features[name].shape if name in self.features else (1,)
        try:
            return column.to_numpy(zero_copy_only=False).reshape(episode.length, *(() if shape == (1,) else shape))
        except ValueError as error:
            raise DatasetError(f"{name} of episode {episode.index} is not {shape}, as info.json says.") from error

    def pictures(self, episode: RecordedEpisode, name: str) -> Iterator[NDArray[np.uint8]]:
        """Yield the pictures (height, width, 3) of an episode's video, in order. Raises DatasetError: it is damaged."""
        path, av = self.root / episode.video_file(self.info["video_path"], name), extra("av")
        first, count = float(episode.row[f"videos/{name}/from_timestamp"]), 0
        try:
            with av.open(str(path)) as video:
                for frame in video.decode(video=0):
                    # Pictures of other episodes may be in the same file.
                    if count < episode.length and (frame.time is None or frame.time > first - 0.5 / self.fps):
                        count += 1
                        yield frame.to_ndarray(format="rgb24")
        except (OSError, IndexError, av.FFmpegError) as error:
            raise DatasetError(f"The video {path} of episode {episode.index} cannot be read: {error}.") from error
        if count < episode.length:
            raise DatasetError(f"The video {path} ends after {count} of the {episode.length} frames of its episode.")


def _read_json(root: Path, name: str) -> dict[str, Any]:
    path = root / name
    try:
        return {**json.loads(path.read_text(encoding="utf-8"))}
    except (OSError, ValueError, TypeError) as error:
        why = getattr(error, "strerror", None) or error
        raise DatasetError(f"{root} is no data set of LeRobot's: {path} cannot be read ({why}).") from error
