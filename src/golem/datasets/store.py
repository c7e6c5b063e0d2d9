"""Reads a data set in LeRobot's format v3.0, of ours or of others."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.datasets.schema import ABOUT, DATA, EPISODES, INFO, TASKS, VERSION, DatasetError, extra, read_features


@dataclass(frozen=True, slots=True)
class RecordedEpisode:
    """One episode.

    Attributes:
        index: its number.
        row: all that meta/episodes says of it.
    """

    index: int
    row: Mapping[str, Any]

    @property
    def length(self) -> int:
        """How many frames it has."""
        return int(self.row["length"])

    @property
    def tasks(self) -> list[str]:
        """What was done."""
        return list(self.row["tasks"])

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
        root: its folder.
        info: what info.json says.
        about: what golem.json says; empty in a data set of others.
        features: by name.
        tasks: in their order.
        episodes: in their order.
    """

    def __init__(self, root: Path) -> None:
        """Read the metadata of the data set in `root`.

        Raises:
            DatasetError: there is none, it is of another version, empty, or its metadata is damaged.
            MissingExtra: the extra `data` is not installed.
        """
        pq = extra("pyarrow.parquet")
        self.root = root
        self.info: dict[str, Any] = self._json(INFO)
        version = self.info.get("codebase_version")
        if version != VERSION:
            raise DatasetError(
                f"The data set {root} is of LeRobot's version {version}, not {VERSION}; `python -m "
                "lerobot.datasets.v30.convert_dataset_v21_to_v30` of the package lerobot converts one of v2.1."
            )
        try:
            self.features = read_features(self.info)
            self.fps = int(self.info["fps"])
            files = sorted((root / EPISODES).glob("*/*.parquet"))
            rows = [row for file in files for row in pq.read_table(file).to_pylist()]
            tasks = pq.read_table(root / TASKS).to_pydict()
            words = next(v for k, v in tasks.items() if k != "task_index")
            self.tasks = [words[tasks["task_index"].index(k)] for k in range(len(words))]
            self.episodes = [
                RecordedEpisode(int(r["episode_index"]), r) for r in sorted(rows, key=lambda r: r["episode_index"])
            ]
            lengths = sum(episode.length for episode in self.episodes)
        except (KeyError, ValueError, TypeError, OSError, StopIteration, extra("pyarrow").ArrowException) as error:
            raise DatasetError(f"The metadata of the data set {root} is damaged: {error!r}.") from error
        self.about: dict[str, Any] = self._json(ABOUT) if (root / ABOUT).exists() else {}
        if not self.episodes or not lengths:
            raise DatasetError(f"The data set {root} has no frames; record an episode first.")
        if (len(self.episodes), lengths) != (self.info.get("total_episodes"), self.info.get("total_frames")):
            raise DatasetError(
                f"The data set {root} has {len(self.episodes)} episodes of {lengths} frames, and its info.json says "
                f"{self.info.get('total_episodes')} of {self.info.get('total_frames')}: a writer was ended halfway."
            )

    @property
    def videos(self) -> list[str]:
        """The features that are in videos."""
        return [name for name, feature in self.features.items() if feature.is_video]

    def require(self, *names: str, like: Mapping[str, Sequence[str]] | None = None) -> None:
        """Check that it has features, vectors with the names that `like` gives for them.

        Raises:
            DatasetError: it has not: it is of another robot, or recorded without them.
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
        """Return one episode.

        Raises:
            DatasetError: there is none of that number.
        """
        if not 0 <= index < len(self.episodes):
            raise DatasetError(f"The data set {self.root} has episodes 0 to {len(self.episodes) - 1}, no {index}.")
        return self.episodes[index]

    def table(self, episode: RecordedEpisode, columns: Sequence[str] | None = None) -> Any:
        """Return the frames of an episode as an Arrow table.

        Raises:
            DatasetError: its file is missing or damaged.
        """
        path = self.root / episode.data_file(self.info.get("data_path") or DATA)
        pq, only = extra("pyarrow.parquet"), [("episode_index", "=", episode.index)]
        try:
            table = pq.read_table(path, columns=None if columns is None else list(columns), filters=only)
        except (OSError, ValueError, extra("pyarrow").ArrowException) as error:
            raise DatasetError(f"The frames of episode {episode.index} cannot be read from {path}: {error}.") from error
        if table.num_rows != episode.length:
            raise DatasetError(f"{path} has {table.num_rows} frames of episode {episode.index}, not {episode.length}.")
        return table

    def values(self, episode: RecordedEpisode, name: str) -> NDArray[Any]:
        """Return the values (n, ...) of one feature of an episode that is in no video; errors as for `table`."""
        column = self.table(episode, [name, "episode_index"])[name].combine_chunks()
        while hasattr(column, "flatten"):
            column = column.flatten() if hasattr(column.type, "value_type") else column
            if not hasattr(column.type, "value_type"):
                break
        shape = self.features[name].shape if name in self.features else (1,)
        flat = column.to_numpy(zero_copy_only=False)
        return flat.reshape(episode.length, *shape) if shape != (1,) else flat.reshape(episode.length)

    def pictures(self, episode: RecordedEpisode, name: str) -> Iterator[NDArray[np.uint8]]:
        """Yield the pictures (height, width, 3) of one video of an episode, in order.

        Raises:
            DatasetError: the video is missing, damaged, or ends too early.
        """
        path = self.root / episode.video_file(self.info["video_path"], name)
        first = float(episode.row[f"videos/{name}/from_timestamp"])
        count, av = 0, extra("av")
        try:
            with av.open(str(path)) as video:
                for frame in video.decode(video=0):
                    # Pictures of other episodes may be in the same file.
                    if frame.time is not None and frame.time < first - 0.5 / self.fps:
                        continue
                    if count == episode.length:
                        break
                    count += 1
                    yield frame.to_ndarray(format="rgb24")
        except (OSError, av.FFmpegError) as error:
            raise DatasetError(f"The video {path} of episode {episode.index} cannot be read: {error}.") from error
        if count < episode.length:
            raise DatasetError(f"The video {path} ends after {count} of the {episode.length} frames of its episode.")

    def _json(self, name: str) -> dict[str, Any]:
        path = self.root / name
        try:
            value = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise DatasetError(f"{self.root} is no data set of LeRobot's: {path} cannot be read ({error}).") from error
        if not isinstance(value, dict):
            raise DatasetError(f"{path} holds no map.")
        return value
