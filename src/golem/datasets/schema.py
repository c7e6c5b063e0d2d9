"""What a data set in LeRobot's format v3.0 is made of: its features, their columns in the table, and its metadata.

After huggingface/lerobot, src/lerobot/datasets/utils.py and lerobot_dataset.py at 0.4.4 (CODEBASE_VERSION "v3.0"). One
episode has one file of data and one per video here, of which the format allows: files then never change.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.policies.vectors import ACTION, COMMAND, EFFORT, STATE
from golem.errors import ConfigError, GolemError, MissingExtra

VERSION, ROBOT, CHUNK = "v3.0", "unitree_h1_2_magpie", 1000
"""Of the format, of our data sets, and files of a folder."""
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
INFO, STATS, TASKS, EPISODES = "meta/info.json", "meta/stats.json", "meta/tasks.parquet", "meta/episodes"
ABOUT = "meta/golem.json"
"""Units, labels of masks, and where it is from: what the format has no place for."""
VECTORS = {"observation.state": STATE, "observation.effort": EFFORT, "action": ACTION, "command.joints": COMMAND}
"""Feature -> names and units."""
INDICES = {"timestamp": "float32", **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64")}
"""What every data set has beside its features, with their types."""


class DatasetError(GolemError):
    """A data set cannot be read: it is none, of another version, of another robot, or a part of it is missing."""


def extra(name: str) -> Any:
    """Import a module of the extra `data`. Raises MissingExtra: it is not installed."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise MissingExtra((error.name or name).partition(".")[0], "data") from error


@dataclass(frozen=True, slots=True)
class Feature:
    """One feature: `dtype` is `video` or NumPy's, `shape` that of a frame's value, `names` of its entries or axes."""

    dtype: str
    shape: tuple[int, ...]
    names: Sequence[str] | None = None

    @property
    def is_video(self) -> bool:
        """Whether its frames are in a video."""
        return self.dtype == "video"

    def described(self, fps: int) -> dict[str, Any]:
        """Return what info.json says of it."""
        names = None if self.names is None else list(self.names)
        out: dict[str, Any] = {"dtype": self.dtype, "shape": list(self.shape), "names": names}
        if self.is_video:
            out["info"] = {
                "video.height": self.shape[0], "video.width": self.shape[1], "video.codec": "av1",
                "video.pix_fmt": "yuv420p", "video.is_depth_map": False, "video.fps": fps,
                "video.channels": self.shape[2], "has_audio": False,
            }  # fmt: skip
        return out


@dataclass(frozen=True)
class Recipe:
    """What is recorded.

    Attributes:
        fps: frames per second of robot time.
        cameras: pictures of these, with width and height [px].
        depth: whether with their depth, uint16 [mm].
        masks: labels whose masks are recorded for each camera, as uint8: 0 is nothing, k the k-th label.
    """

    fps: int = 15
    cameras: Mapping[str, tuple[int, int]] = field(default_factory=dict[str, tuple[int, int]])
    depth: bool = False
    masks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not 1 <= self.fps <= 500 or len(self.masks) > 255:
            raise ConfigError(
                f"A data set has 1 to 500 frames a second, not {self.fps}, and masks of up to 255 labels."
            )

    def features(self) -> dict[str, Feature]:
        """Return its features by name."""
        out = {name: Feature("float32", (len(entries),), list(entries)) for name, entries in VECTORS.items()}
        for name, (width, height) in self.cameras.items():
            out[f"observation.images.{name}"] = Feature("video", (height, width, 3), ("height", "width", "channels"))
            for kind, dtype, wanted in (("depth", "uint16", self.depth), ("masks", "uint8", self.masks)):
                if wanted:
                    out[f"observation.{kind}.{name}"] = Feature(dtype, (height, width), ("height", "width"))
        return out


def described(features: Mapping[str, Feature], fps: int) -> dict[str, Any]:
    """Return what info.json says of `features` and of what every data set has."""
    every = {name: Feature(dtype, (1,)) for name, dtype in INDICES.items()}
    return {name: feature.described(fps) for name, feature in (dict(features) | every).items()}


def read_features(info: Mapping[str, Any]) -> dict[str, Feature]:
    """Return the features that info.json names, without those that every data set has."""
    out: dict[str, Feature] = {}
    for name, each in info["features"].items():
        names = each.get("names")
        if isinstance(names, dict):  # some data sets group them, as `{"motors": [...]}`
            names = [str(n) for group in names.values() for n in group]
        dtype, shape = str(each["dtype"]), tuple(map(int, each["shape"]))
        if min(shape) < 1 or (dtype == "video" and len(shape) != 3):
            raise ValueError(f"{name} has the shape {shape}")
        out[name] = Feature(dtype, shape, None if names is None else list(names))
    return {name: feature for name, feature in out.items() if name not in INDICES}


def tasks_table(tasks: Sequence[str]) -> Any:
    """Return the table of the tasks, which pandas reads with the sentences as its index."""
    pa = extra("pyarrow")
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, kind, numpy in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    said = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.2.0"}
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks, pa.string())})
    return table.replace_schema_metadata({"pandas": json.dumps(said)})


QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}


def statistics(values: NDArray[Any]) -> dict[str, Any]:
    """Return what is known of the (n, m) values of a feature, by the names that LeRobot has for it."""
    x = values.astype(np.float64)
    quantiles = dict(zip(QUANTILES, np.quantile(x, list(QUANTILES.values()), axis=0), strict=True))
    out = {"min": x.min(0), "max": x.max(0), "mean": x.mean(0), "std": x.std(0), **quantiles}
    return {k: v.tolist() for k, v in out.items()} | {"count": [len(x)]}


def picture_statistics(counts: NDArray[Any], frames: int) -> dict[str, Any]:
    """Return the same of pictures, by channel, from their histogram (3, 256), from 0 to 1 as LeRobot has them."""
    level, share = np.arange(256) / 255.0, counts / counts.sum(1, keepdims=True)
    mean, below = share @ level, share.cumsum(1)
    rows = {"mean": mean, "std": np.sqrt(np.maximum(share @ level**2 - mean**2, 0.0))}
    for name, q in {"min": 1e-12, "max": 1.0 - 1e-12, **QUANTILES}.items():
        rows[name] = level[np.minimum((below < q).sum(1), 255)]
    return {k: v.reshape(3, 1, 1).tolist() for k, v in rows.items()} | {"count": [frames]}


def pooled(episodes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the statistics of one feature over all episodes; quantiles are weighted means, as LeRobot pools them."""
    n = np.array([e["count"][0] for e in episodes], np.float64)
    stacked = {key: np.array([e[key] for e in episodes], np.float64) for key in episodes[0] if key != "count"}
    weight = (n / n.sum()).reshape(-1, *[1] * (stacked["mean"].ndim - 1))
    out = {key: (weight * value).sum(0) for key, value in stacked.items()}
    out["min"], out["max"] = stacked["min"].min(0), stacked["max"].max(0)
    out["std"] = np.sqrt((weight * (stacked["std"] ** 2 + (stacked["mean"] - out["mean"]) ** 2)).sum(0))
    return {key: value.tolist() for key, value in out.items()} | {"count": [int(n.sum())]}
