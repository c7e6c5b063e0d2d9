"""Writes data sets: an episode is in one whole, or not at all, whenever the process ends."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from golem.datasets.schema import (
    ABOUT,
    CHUNK,
    CODEC,
    CRF,
    DATA,
    EPISODES,
    GOP,
    INFO,
    ROBOT,
    STATS,
    TASKS,
    VERSION,
    VIDEO,
    DatasetError,
    Feature,
    Recipe,
    described,
    extra,
    picture_statistics,
    pooled,
    read_features,
    statistics,
    tasks_table,
)
from golem.datasets.store import DatasetFolder
from golem.datasets.swap import beside, held, link, replaced
from golem.errors import OutputError

BATCH = 64
"""Frames whose depth and masks are held in memory [own: 40 MB of VGA depth]."""
LOOK = 8
"""Of each picture every so many pixels go into its statistics, along both axes."""


@dataclass
class Draft:
    """An episode in the making or one that is whole, before it has its number.

    Attributes:
        tasks: what is done in it.
        length: frames.
        data: its file of data.
        videos: its files by feature; its pictures begin at `starts` in them [s].
        stats: by feature.
    """

    tasks: list[str]
    length: int
    data: Path
    videos: dict[str, Path]
    stats: dict[str, Any]
    starts: dict[str, float] = field(default_factory=dict[str, float])


class Video:
    """One video file in the making."""

    def __init__(self, path: Path, feature: Feature, fps: int) -> None:
        """Create it."""
        os.environ.setdefault("SVT_LOG", "1")  # else the encoder writes a page to the terminal
        av = extra("av")
        self._av, self._path, self._shape, self._n = av, path, feature.shape, 0
        self._out = av.open(str(path), "w")
        options = {"crf": str(CRF), "g": str(GOP), "preset": "11"}
        self._stream = self._out.add_stream(CODEC, rate=fps, options=options)
        self._stream.height, self._stream.width = feature.shape[:2]
        self._stream.pix_fmt = "yuv420p"
        self.counts = np.zeros((3, 256))

    def add(self, picture: np.ndarray[Any, Any]) -> None:
        """Append one picture (height, width, 3)."""
        for packet in self._stream.encode(self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), "rgb24")):
            self._out.mux(packet)
        for channel in range(3):
            self.counts[channel] += np.bincount(picture[::LOOK, ::LOOK, channel].ravel(), minlength=256)

    def finish(self) -> None:
        """Complete the file."""
        for packet in self._stream.encode():
            self._out.mux(packet)
        self._out.close()

    def drop(self) -> None:
        """Close without completing."""
        with suppress(Exception):
            self._out.close()


class DatasetWriter:
    """Records episodes into a data set that is new or goes on.

    Attributes:
        root: folder of the data set.
        episodes: how many are in it.
    """

    def __init__(self, root: Path, recipe: Recipe, origin: str = "") -> None:
        """Take the data set in `root`, or begin one; `origin` says where it is from.

        Raises:
            DatasetError: what is there was recorded otherwise.
            OutputError: another process writes it, or the place cannot be written.
            MissingExtra: the extra `data` is not installed.
        """
        extra("pyarrow.parquet"), extra("av")
        self.root, self._features, self._fps = root, recipe.features(), recipe.fps
        self._exit = ExitStack()
        self._exit.enter_context(held(root))
        try:
            self._about = {
                "origin": origin,
                "units": {k: f.units for k, f in self._features.items() if f.units} | {"observation.depth": "mm"},
                "frames": "palms, velocities and `up` in base_link: x forward, z up; palms: z approach, y closing",
                "masks": list(recipe.masks),
            }
            self.episodes = 0
            if root.exists() and any(root.iterdir()):
                there = DatasetFolder(root)
                here = described(self._features, self._fps)
                # By way of JSON, where a tuple is a list.
                if there.fps != self._fps or there.info["features"] != json.loads(json.dumps(here)):
                    raise DatasetError(
                        f"The data set {root} was recorded otherwise ({there.fps} fps; {', '.join(there.features)}), "
                        "and an episode like this does not fit; give another folder."
                    )
                self.episodes = len(there.episodes)
        except BaseException:
            self._exit.close()
            raise
        self._rows: dict[str, list[Any]] = {}
        self._videos: dict[str, Video] = {}
        self._table: Any = None
        self._task = ""

    def begin(self, task: str) -> None:
        """Begin an episode in which `task`, a sentence, is done; one that was begun before is forgotten."""
        self.discard()
        self._task, folder = task, beside(self.root, "episode")
        try:
            folder.mkdir()
            self._videos = {
                name: Video(folder / f"{name}.mp4", feature, self._fps)
                for name, feature in self._features.items()
                if feature.is_video
            }
        except (OSError, extra("av").FFmpegError) as error:
            raise self._unwritable(error) from error
        self._rows = {name: [] for name, feature in self._features.items() if not feature.is_video}
        self._kept: dict[str, list[Any]] = {name: [] for name in self._rows if len(self._features[name].shape) == 1}
        self.length = 0

    def add(self, frame: Mapping[str, Any]) -> None:
        """Append a frame: a value for each feature.

        Raises:
            DatasetError: a value is missing, has another shape, or is not finite; the frame is not recorded.
            OutputError: it cannot be written; the episode is lost, and the data set as it was.
        """
        values: dict[str, np.ndarray[Any, Any]] = {}
        for name, feature in self._features.items():
            value = np.asarray(frame[name] if name in frame else np.nan)
            if value.shape != feature.shape or not (feature.is_video or np.isfinite(value).all()):
                raise DatasetError(f"The {name} of a frame is finite and of shape {feature.shape}, not {value.shape}.")
            values[name] = value.astype(np.uint8 if feature.is_video else feature.dtype, copy=False)
        try:
            for name, video in self._videos.items():
                video.add(values[name])
            for name, rows in self._rows.items():
                rows.append(values[name].copy())
                if name in self._kept:
                    self._kept[name].append(rows[-1])
            self.length += 1
            if self.length % BATCH == 0:
                self._flush()
        except (OSError, extra("av").FFmpegError) as error:
            raise self._unwritable(error) from error

    def finish(self) -> int:
        """Complete the episode and put it into the data set; returns its number.

        Raises:
            DatasetError: it has no frames.
            OutputError: it cannot be written; the data set is as it was.
        """
        if not self._rows or not self.length:
            self.discard()
            raise DatasetError("An episode without frames is no episode.")
        folder = beside(self.root, "episode")
        try:
            self._flush()
            self._table.close()
            self._table = None
            stats = {name: statistics(np.array(rows)) for name, rows in self._kept.items()}
            for name, video in self._videos.items():
                video.finish()
                stats[name] = picture_statistics(video.counts, self.length)
            videos = {name: folder / f"{name}.mp4" for name in self._videos}
            old = drafts(DatasetFolder(self.root)) if self.episodes else []
            new = Draft([self._task], self.length, folder / "data.parquet", videos, stats)
            compose(self.root, [*old, new], self._features, self._fps, self._about)
        except (OSError, extra("av").FFmpegError) as error:
            raise self._unwritable(error) from error
        finally:
            self.discard()
        self.episodes += 1
        return self.episodes - 1

    def discard(self) -> None:
        """Forget the episode in the making."""
        for video in self._videos.values():
            video.drop()
        if self._table is not None:
            with suppress(Exception):
                self._table.close()
        self._videos, self._rows, self._table = {}, {}, None
        shutil.rmtree(beside(self.root, "episode"), ignore_errors=True)

    def close(self) -> None:
        """Forget what is not finished, and let others write."""
        self.discard()
        self._exit.close()

    def _flush(self) -> None:
        count = len(next(iter(self._rows.values())))
        if not count and self._table is not None:
            return
        first = self.length - count
        columns = {name: rows for name, rows in self._rows.items()}
        table = frames_table(columns, self._features, first, self._fps)
        if self._table is None:
            path = beside(self.root, "episode") / "data.parquet"
            self._table = extra("pyarrow.parquet").ParquetWriter(path, table.schema, compression="zstd")
        self._table.write_table(table)
        self._rows = {name: [] for name in self._rows}

    def _unwritable(self, error: Exception) -> OutputError:
        self.discard()
        why = getattr(error, "strerror", None) or error
        return OutputError(f"Cannot write an episode of {self.root}: {why}; those that were finished are kept.")


def frames_table(rows: Mapping[str, Sequence[Any]], features: Mapping[str, Feature], first: int, fps: int) -> Any:
    """Return frames as a table, numbered from `first` in an episode that has no number yet."""
    pa = extra("pyarrow")
    n = len(next(iter(rows.values())))
    columns = {name: _column(np.array(values), features[name]) for name, values in rows.items()}
    at = np.arange(first, first + n)
    columns["timestamp"] = pa.array((at / fps).astype(np.float32))
    columns |= {name: pa.array(at) for name in ("frame_index", "index")}
    columns |= {name: pa.array(np.zeros(n, np.int64)) for name in ("episode_index", "task_index")}
    return pa.table(columns)


def _column(values: np.ndarray[Any, Any], feature: Feature) -> Any:
    pa = extra("pyarrow")
    flat = pa.array(values.reshape(-1))
    if feature.shape == (1,):
        return flat
    if len(feature.shape) == 1:
        return pa.FixedSizeListArray.from_arrays(flat, feature.shape[0])
    n, (height, width) = len(values), feature.shape
    lines = pa.ListArray.from_arrays(pa.array(np.arange(0, n * height * width + 1, width, dtype=np.int32)), flat)
    return pa.ListArray.from_arrays(pa.array(np.arange(0, n * height + 1, height, dtype=np.int32)), lines)


def drafts(dataset: DatasetFolder, chosen: Sequence[int] | None = None) -> list[Draft]:
    """Return episodes of a data set, by default all, as those of another one.

    Raises:
        DatasetError: there is no such episode, or one has no file of its own.
    """
    out: list[Draft] = []
    owners: dict[str, int] = {}
    for episode in dataset.episodes:
        path = episode.data_file(dataset.info["data_path"])
        owners[path] = owners.get(path, 0) + 1
    for index in range(len(dataset.episodes)) if chosen is None else chosen:
        episode = dataset.episode(index)
        data = episode.data_file(dataset.info["data_path"])
        if owners[data] > 1:
            raise DatasetError(
                f"{dataset.root / data} holds several episodes; only data sets with a file per episode, as "
                "GOLEM writes them, are changed here; lerobot-edit-dataset of the package lerobot changes others."
            )
        videos = {v: dataset.root / episode.video_file(dataset.info["video_path"], v) for v in dataset.videos}
        missing = next((path for path in (dataset.root / data, *videos.values()) if not path.exists()), None)
        if missing is not None:
            raise DatasetError(f"{missing} of episode {index} is missing.")
        starts = {v: float(episode.row[f"videos/{v}/from_timestamp"]) for v in dataset.videos}
        out.append(Draft(episode.tasks, episode.length, dataset.root / data, videos, episode.statistics(), starts))
    return out


def compose(
    root: Path, episodes: Sequence[Draft], features: Mapping[str, Feature], fps: int, about: Mapping[str, Any]
) -> None:
    """Let `root` be a data set of `episodes` in this order, whole or not at all; its writer is `held`.

    Files that need no change are linked.

    Raises:
        DatasetError: there are none.
        OutputError: it cannot be written; what was there is unchanged.
    """
    if not episodes:
        raise DatasetError("A data set without episodes is none; remove its folder instead.")
    pa, pq = extra("pyarrow"), extra("pyarrow.parquet")
    tasks = list(dict.fromkeys(task for episode in episodes for task in episode.tasks))
    rows: list[dict[str, Any]] = []
    with replaced(root) as new:
        first = 0
        for k, episode in enumerate(episodes):
            at = {"chunk_index": k // CHUNK, "file_index": k % CHUNK}
            target = new / DATA.format(**at)
            _renumbered(episode, target, k, first, tasks)
            row: dict[str, Any] = {
                "episode_index": k, "tasks": episode.tasks, "length": episode.length,
                "dataset_from_index": first, "dataset_to_index": first + episode.length,
                "meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0,
            }  # fmt: skip
            row |= {f"data/{name}": value for name, value in at.items()}
            for key, path in episode.videos.items():
                link(path, new / VIDEO.format(video_key=key, **at))
                start = episode.starts.get(key, 0.0)
                row |= {f"videos/{key}/{name}": value for name, value in at.items()}
                row |= {f"videos/{key}/from_timestamp": start}
                row |= {f"videos/{key}/to_timestamp": start + episode.length / fps}
            row |= {f"stats/{name}/{k}": v for name, each in episode.stats.items() for k, v in each.items()}
            rows.append(row)
            first += episode.length
        (new / EPISODES / "chunk-000").mkdir(parents=True)
        pq.write_table(pa.Table.from_pylist(rows), new / EPISODES / "chunk-000" / "file-000.parquet")
        pq.write_table(tasks_table(tasks), new / TASKS)
        names = [n for n in episodes[0].stats if all(n in e.stats for e in episodes)]
        _write_json(new / STATS, {name: pooled([e.stats[name] for e in episodes]) for name in names})
        _write_json(new / ABOUT, about)
        info = {
            "codebase_version": VERSION, "robot_type": ROBOT, "total_episodes": len(rows), "total_frames": first,
            "total_tasks": len(tasks), "chunks_size": CHUNK, "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200, "fps": fps, "splits": {"train": f"0:{len(rows)}"}, "data_path": DATA,
            "video_path": VIDEO if episodes[0].videos else None, "features": described(features, fps),
        }  # fmt: skip
        _write_json(new / INFO, info)


def _renumbered(episode: Draft, target: Path, index: int, first: int, tasks: Sequence[str]) -> None:
    """Put the data of an episode at `target`, with its numbers; linked where it has them already."""
    pa, pq = extra("pyarrow"), extra("pyarrow.parquet")
    target.parent.mkdir(parents=True, exist_ok=True)
    task = tasks.index(episode.tasks[0])
    with pq.ParquetFile(episode.data) as source:
        head = next(source.iter_batches(1, columns=["episode_index", "index", "task_index"])).to_pylist()[0]
        if (head["episode_index"], head["index"], head["task_index"]) == (index, first, task):
            link(episode.data, target)
            return
        with pq.ParquetWriter(target, source.schema_arrow, compression="zstd") as out:
            for group in range(source.num_row_groups):
                table = source.read_row_group(group)
                n, at = table.num_rows, table.column_names.index
                new = {
                    "episode_index": np.full(n, index), "index": table["frame_index"].to_numpy() + first,
                    "task_index": np.full(n, task),
                }  # fmt: skip
                for name, values in new.items():
                    table = table.set_column(at(name), name, pa.array(values.astype(np.int64)))
                out.write_table(table)


def _write_json(path: Path, value: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def rewritten(dataset: DatasetFolder, root: Path, episodes: Sequence[Draft]) -> None:
    """Let `root` be a data set like `dataset` of `episodes`; errors as for `compose`."""
    with held(root):
        compose(root, episodes, read_features(dataset.info), dataset.fps, dataset.about)
