"""Writes data sets: an episode is in one whole, or not at all, whenever the process ends."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.datasets import schema
from golem.datasets.own_priority import own_priority
from golem.datasets.schema import DatasetError, Feature, Recipe, extra
from golem.datasets.store import DatasetFolder
from golem.datasets.swap import beside, held, link, replaced
from golem.errors import OutputError

CODEC, GOP, CRF = "libsvtav1", 10, 30
"""Encoder (BSD, as LeRobot's own), distance of key frames, quality [own: LeRobot's 2 takes five times the CPU]."""
LEVEL = "lp=1"
"""Least parallelism: with more, SVT-AV1 4.1 loses the order of pictures on a busy machine, for the same
bits and 1.4 times the CPU [own]."""
BATCH = 64
"""Frames whose depth and masks are held in memory [own: 40 MB of VGA depth]."""
LONGEST = 1800.0
"""Time after which an episode goes on as the next one [s]: beyond 2048 s times in float32, as the format has them, are
farther off than LeRobot's tolerance."""
LOOK = 8
"""Of each picture every so many pixels go into its statistics, along both axes."""


@dataclass
class Draft:
    """An episode that is whole, before it has its number.

    Attributes:
        tasks, length, stats: as in meta/episodes.
        data: its file of data.
        videos: its files by feature; its pictures begin at `starts` in them [s].
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
        os.environ.setdefault("SVT_LOG", "1")  # else the encoder writes a page to the terminal
        self._av, self.counts, self._written = extra("av"), np.zeros((3, 256)), 0
        self._out = self._av.open(str(path), "w")
        options = {"crf": f"{CRF}", "g": f"{GOP}", "preset": "11", "svtav1-params": LEVEL}
        self._stream = self._out.add_stream(CODEC, rate=fps, options=options)
        self._stream.height, self._stream.width = feature.shape[:2]
        self._stream.pix_fmt = "yuv420p"
        with own_priority():
            self._stream.codec_context.open()

    def add(self, picture: NDArray[Any]) -> None:
        """Append one picture (height, width, 3)."""
        self._write(self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), "rgb24"))
        for channel in range(3):
            self.counts[channel] += np.bincount(picture[::LOOK, ::LOOK, channel].ravel(), minlength=256)

    def finish(self, length: int) -> None:
        """Complete the file of `length` pictures; an OSError if the encoder kept one to itself."""
        self._write(None)
        self._out.close()
        if self._written != length:
            raise OSError(f"the encoder gave {self._written} of {length} pictures")

    def _write(self, frame: Any) -> None:
        """Encode a frame, or what is left, and write it: each packet shows one picture."""
        packets = self._stream.encode(frame)
        self._out.mux(packets)
        self._written += len(packets)

    def drop(self) -> None:
        """Close without completing."""
        with suppress(Exception):
            self._out.close()


class DatasetWriter:
    """Records `episodes` into a data set that is new or goes on; `length` counts frames of the one in the making."""

    def __init__(self, root: Path, recipe: Recipe, origin: str = "") -> None:
        """Take the data set in `root`, or begin one; `origin` says where it is from.

        Raises:
            DatasetError: what is there was recorded otherwise.
            OutputError: another process writes it, or the place cannot be written.
            MissingExtra: the extra `data` is not installed.
        """
        for package in ("pyarrow.parquet", "av"):
            extra(package)
        self.root, self._features, self._fps, self.episodes, self.length = root, recipe.features(), recipe.fps, 0, 0
        self._about = {
            "origin": origin,
            "units": {k: list(v.values()) for k, v in schema.VECTORS.items()} | {"observation.depth": "mm"},
            "frames": "palms, velocities and `up` in base_link: x forward, z up; palms: z approach, y closing",
            "masks": list(recipe.masks),
        }
        self._rows: dict[str, list[Any]] = {}
        self._videos: dict[str, Video] = {}
        self._table: Any = None
        self._folder = beside(root, "episode")
        with ExitStack() as held_:
            held_.enter_context(held(root))
            if root.exists() and any(root.iterdir()):
                there, here = DatasetFolder(root), schema.described(self._features, self._fps)
                # By way of JSON, where a tuple is a list.
                if there.info["features"] != json.loads(json.dumps(here)) or there.fps != self._fps:
                    raise DatasetError(
                        f"The data set {root} was recorded otherwise ({there.fps} fps; {', '.join(there.features)}), "
                        "and an episode like this does not fit; give another folder."
                    )
                if there.labels != list(recipe.masks):
                    said = " ".join(there.labels)
                    raise DatasetError(f"The data set {root} has --masks {said}, in this order; give another folder.")
                self.episodes = len(there.episodes)
            self._exit = held_.pop_all()

    def begin(self, task: str) -> None:
        """Begin an episode in which `task`, a sentence, is done; one that was begun before is forgotten."""
        self.discard()
        self._task, self.length = task, 0
        with self._writable():
            self._folder.mkdir()
            for name, feature in self._features.items():
                if feature.is_video:
                    self._videos[name] = Video(self._folder / f"{name}.mp4", feature, self._fps)
        self._rows = {name: [] for name, feature in self._features.items() if not feature.is_video}
        self._kept: dict[str, list[Any]] = {name: [] for name in self._rows if len(self._features[name].shape) == 1}

    def add(self, frame: Mapping[str, Any]) -> None:
        """Append a frame: a value for each feature. After `LONGEST` it is the first of a new episode.

        Raises:
            DatasetError: a value is missing, has another shape, or is not finite; the frame is not recorded.
            OutputError: it cannot be written; the episode is lost, and the data set as it was.
        """
        values: dict[str, NDArray[Any]] = {}
        for name, feature in self._features.items():
            value = np.asarray(frame.get(name, np.nan))
            if value.shape != feature.shape or not (feature.is_video or np.isfinite(value).all()):
                raise DatasetError(f"The {name} of a frame is finite and of shape {feature.shape}, not {value.shape}.")
            values[name] = value.astype(np.uint8 if feature.is_video else feature.dtype)
        if self.length >= LONGEST * self._fps:
            self.finish()
            self.begin(self._task)
        with self._writable():
            for name, video in self._videos.items():
                video.add(values[name])
            for name, rows in self._rows.items():
                rows.append(values[name])
                self._kept.get(name, []).append(values[name])
            self.length += 1
            if self.length % BATCH == 0:
                self._flush()

    def finish(self) -> int:
        """Complete the episode and put it into the data set; returns its number.

        Raises:
            DatasetError: it has no frames.
            OutputError: it cannot be written; the data set is as it was.
        """
        try:
            if not self._rows or not self.length:
                raise DatasetError("An episode without frames is no episode.")
            with self._writable():
                self._flush()
                self._table.close()
                stats = {name: schema.statistics(np.array(rows)) for name, rows in self._kept.items()}
                for name, video in self._videos.items():
                    video.finish(self.length)
                    stats[name] = schema.picture_statistics(video.counts, self.length)
                videos = {name: self._folder / f"{name}.mp4" for name in self._videos}
                new = Draft([self._task], self.length, self._folder / "data.parquet", videos, stats)
                old = drafts(DatasetFolder(self.root)) if self.episodes else []
                compose(self.root, [*old, new], self._features, self._fps, self._about)
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
        shutil.rmtree(self._folder, ignore_errors=True)

    def close(self) -> None:
        """Forget what is not finished, and let others write."""
        self.discard()
        self._exit.close()

    def _flush(self) -> None:
        """Write the rows that wait, numbered as of an episode that has no number yet."""
        pa, count = extra("pyarrow"), len(next(iter(self._rows.values())))
        if not count and self._table is not None:
            return
        columns = {name: _column(np.array(values), self._features[name]) for name, values in self._rows.items()}
        at = np.arange(self.length - count, self.length)
        columns["timestamp"] = pa.array((at / self._fps).astype(np.float32))
        columns |= {name: pa.array(at) for name in ("frame_index", "index")}
        columns |= {name: pa.array(np.zeros_like(at)) for name in ("episode_index", "task_index")}
        table = pa.table(columns)
        if self._table is None:
            path = self._folder / "data.parquet"
            self._table = extra("pyarrow.parquet").ParquetWriter(path, table.schema, compression="zstd")
        self._table.write_table(table)
        self._rows = {name: [] for name in self._rows}

    @contextmanager
    def _writable(self) -> Iterator[None]:
        """Forget the episode where something in here cannot be written, and say so."""
        try:
            yield
        except (OSError, extra("av").FFmpegError) as error:
            self.discard()
            why = getattr(error, "strerror", None) or error
            kept = "those that were finished are kept"
            raise OutputError(f"Cannot write an episode of {self.root}: {why}; {kept}.") from error


def _column(values: NDArray[Any], feature: Feature) -> Any:
    pa = extra("pyarrow")
    flat, n = pa.array(values.reshape(-1)), len(values)
    if len(feature.shape) == 1:
        return flat if feature.shape == (1,) else pa.FixedSizeListArray.from_arrays(flat, feature.shape[0])
    for size in (feature.shape[1] * np.arange(n * feature.shape[0] + 1), feature.shape[0] * np.arange(n + 1)):
        flat = pa.ListArray.from_arrays(pa.array(size.astype(np.int32)), flat)
    return flat


def drafts(dataset: DatasetFolder, chosen: Sequence[int] | None = None) -> list[Draft]:
    """Return episodes of a data set, by default all, as those of another one.

    Raises DatasetError: there is no such episode, a file of one is missing, or it is in a file with others.
    """
    out: list[Draft] = []
    files = [episode.data_file(dataset.info["data_path"]) for episode in dataset.episodes]
    for index in range(len(files)) if chosen is None else chosen:
        episode = dataset.episode(index)
        if files.count(files[index]) > 1:
            raise DatasetError(
                f"{dataset.root / files[index]} holds several episodes; only data sets with a file per episode, as "
                "GOLEM writes them, are changed here; lerobot-edit-dataset of the package lerobot changes others."
            )
        data = dataset.root / files[index]
        videos = {v: dataset.root / episode.video_file(dataset.info["video_path"], v) for v in dataset.videos}
        missing = next((path for path in (data, *videos.values()) if not path.exists()), None)
        if missing is not None:
            raise DatasetError(f"{missing} of episode {index} is missing.")
        starts = {v: float(episode.row[f"videos/{v}/from_timestamp"]) for v in dataset.videos}
        out.append(Draft(episode.tasks, episode.length, data, videos, episode.statistics(), starts))
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
            at = {"chunk_index": k // schema.CHUNK, "file_index": k % schema.CHUNK}
            _renumbered(episode, new / schema.DATA.format(**at), k, first, tasks.index(episode.tasks[0]))
            row: dict[str, Any] = {
                "episode_index": k, "tasks": episode.tasks, "length": episode.length,
                "dataset_from_index": first, "dataset_to_index": first + episode.length,
                "meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0,
            }  # fmt: skip
            row |= {f"data/{name}": value for name, value in at.items()}
            for key, path in episode.videos.items():
                link(path, new / schema.VIDEO.format(video_key=key, **at))
                start = episode.starts.get(key, 0.0)
                span = {"from_timestamp": start, "to_timestamp": start + episode.length / fps}
                row |= {f"videos/{key}/{name}": value for name, value in (at | span).items()}
            row |= {f"stats/{name}/{k}": v for name, each in episode.stats.items() for k, v in each.items()}
            rows.append(row)
            first += episode.length
        (new / schema.EPISODES / "chunk-000").mkdir(parents=True)
        pq.write_table(pa.Table.from_pylist(rows), new / schema.EPISODES / "chunk-000" / "file-000.parquet")
        pq.write_table(schema.tasks_table(tasks), new / schema.TASKS)
        known = [n for n in episodes[0].stats if all(n in e.stats for e in episodes)]
        _write_json(new / schema.STATS, {name: schema.pooled([e.stats[name] for e in episodes]) for name in known})
        _write_json(new / schema.ABOUT, about)
        info = {
            "codebase_version": schema.VERSION, "robot_type": schema.ROBOT, "total_episodes": len(rows),
            "total_frames": first, "total_tasks": len(tasks), "chunks_size": schema.CHUNK,
            "data_files_size_in_mb": 100, "video_files_size_in_mb": 200, "fps": fps,
            "splits": {"train": f"0:{len(rows)}"}, "data_path": schema.DATA,
            "video_path": schema.VIDEO if episodes[0].videos else None,
            "features": schema.described(features, fps),
        }  # fmt: skip
        _write_json(new / schema.INFO, info)


def _renumbered(episode: Draft, target: Path, index: int, first: int, task: int) -> None:
    """Put the data of an episode at `target`, with its numbers; linked where it has them already."""
    pa, pq = extra("pyarrow"), extra("pyarrow.parquet")
    target.parent.mkdir(parents=True, exist_ok=True)
    wanted = {"episode_index": index, "index": first, "task_index": task}
    with pq.ParquetFile(episode.data) as source:
        if next(source.iter_batches(1, columns=list(wanted))).to_pylist()[0] == wanted:
            link(episode.data, target)
            return
        with pq.ParquetWriter(target, source.schema_arrow, compression="zstd") as out:
            for group in range(source.num_row_groups):
                table = source.read_row_group(group)
                frames = table["frame_index"].to_numpy()
                for name, value in wanted.items():
                    values = value + (frames if name == "index" else np.zeros_like(frames))
                    table = table.set_column(table.column_names.index(name), name, pa.array(values))
                out.write_table(table)


def _write_json(path: Path, value: Any) -> None:
    path.write_text(json.dumps(value, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def rewritten(dataset: DatasetFolder, root: Path, episodes: Sequence[Draft]) -> None:
    """Let `root` be a data set like `dataset` of `episodes`; errors as for `compose`."""
    with held(root):
        compose(root, episodes, schema.read_features(dataset.info), dataset.fps, dataset.about)
