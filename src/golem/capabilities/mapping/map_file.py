"""Maps on disk: the image and YAML file of ROS's map_server, and the voxels of the same map beside them.

The image has one byte per cell, its first row the last of the grid: 254 free, 0 occupied, 205 unknown. The file says
`free_thresh: 0.196`: with Nav2's 0.25 an unknown cell would be read as free. Images are read by the rule of Nav2 from
Jazzy on (ros-navigation/navigation2, nav2_map_server/src/map_io.cpp): what is transparent is unknown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from golem.errors import ConfigError, OutputError
from golem.options import read_yaml
from golem.types import Array, PlanarPose

OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
_KINDS = ("PPM", "PNG", "BMP", "JPEG", "GIF", "TIFF", "WEBP")
_LUMA = np.array([0.212656, 0.715158, 0.072186])
"""Grey of red, green and blue (Rec. 709), as ImageMagick has it."""
_WRITTEN = {0: 254, 100: 0, -1: 205}
CLOUD = ".npz"
"""Ending of the file of the voxels, beside the YAML file of the same name."""


@dataclass(frozen=True, slots=True)
class StoredMap:
    """A map as a file has it.

    Attributes:
        origin: pose of the corner of cell [0, 0] in the map's frame.
        resolution: side of a cell [m].
        cells: (rows, columns) int8, see `OccupancyGrid`.
        cloud: (n, 3) middles of the occupied voxels in the map's frame [m]; n is 0 where there is no such file.
        walls: (n, 2) places of upright surfaces, finer than the cells, in the map's frame [m]; likewise.
    """

    origin: PlanarPose
    resolution: float
    cells: NDArray[np.int8]
    cloud: Array
    walls: Array


def save_map(path: Path, stored: StoredMap) -> None:
    """Write `PATH.yaml`, `PATH.pgm` and `PATH.npz`; the folder is made. Raises OutputError: it cannot be written."""
    base = path.with_suffix("") if path.suffix in (".yaml", ".yml") else path
    cells = stored.cells
    image = np.full(cells.shape, _WRITTEN[-1], np.uint8)
    image[(cells >= 0) & (cells < 100 * OCCUPIED_THRESH)] = _WRITTEN[0]
    image[cells >= 100 * OCCUPIED_THRESH] = _WRITTEN[100]
    rows, columns = cells.shape
    o = stored.origin
    facts = {
        "image": f"{base.name}.pgm",
        "mode": "trinary",
        "resolution": float(stored.resolution),
        "origin": [float(o.x), float(o.y), float(o.yaw)],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESH,
        "free_thresh": FREE_THRESH,
    }
    try:
        base.parent.mkdir(parents=True, exist_ok=True)
        base.with_name(f"{base.name}.pgm").write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + image[::-1].tobytes())
        base.with_name(f"{base.name}.yaml").write_text(yaml.safe_dump(facts, sort_keys=False), encoding="utf-8")
        with base.with_name(f"{base.name}{CLOUD}").open("wb") as file:
            np.savez_compressed(file, cloud=stored.cloud.astype(np.float32), walls=stored.walls)
    except OSError as error:
        raise OutputError(f"The map '{path}' cannot be written: {error.strerror}.") from error


def load_map(path: Path) -> StoredMap:
    """Read a map of `save_map` or of ROS's map_saver. Raises ConfigError: a file is missing or no map; says why."""
    file = path if path.suffix in (".yaml", ".yml") else Path(f"{path}.yaml")
    try:
        facts = read_yaml(file.read_text(encoding="utf-8"), f"The map '{file}'")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"The map '{file}' cannot be read: {getattr(error, 'strerror', 'it is no text')}.") from error
    if not isinstance(facts, dict) or not isinstance(facts.get("image"), str):
        raise ConfigError(f"'{file}' is no map: a YAML file of map_server names an image, resolution and origin.")
    resolution = _number(file, facts, "resolution", None)
    if not resolution > 0.0:
        raise ConfigError(f"The map '{file}' has the resolution {resolution:g}; it is a positive number of metres.")
    origin = facts.get("origin")
    if not (isinstance(origin, list) and len(origin) == 3 and all(_finite(v) for v in origin)):
        raise ConfigError(f"The map '{file}' has the origin {origin}; it is [x, y, yaw].")
    occupied, free = _number(file, facts, "occupied_thresh", 0.65), _number(file, facts, "free_thresh", 0.25)
    if not 0.0 <= free <= occupied <= 1.0:
        raise ConfigError(
            f"The map '{file}' has free_thresh {free:g} and occupied_thresh {occupied:g}; they are shares from 0 to 1, "
            "the first no larger than the second."
        )
    negate = facts.get("negate", 0)
    if not isinstance(negate, int):
        raise ConfigError(f"The map '{file}' has the negate {negate}; it is 0 or 1.")
    mode = facts.get("mode", "trinary")
    if mode not in ("trinary", "scale", "raw"):
        raise ConfigError(f"The map '{file}' has the mode '{mode}'; choose from trinary, scale, raw.")
    image, opaque = _image(file.parent / facts["image"])
    cells = _cells(image, bool(negate), occupied, free, str(mode))
    if mode != "raw":
        cells[~opaque[::-1]] = -1
    cloud, walls = _beside(file.with_suffix(CLOUD))
    return StoredMap(PlanarPose(*(float(v) for v in origin)), resolution, cells, cloud, walls)


def _beside(file: Path) -> tuple[Array, Array]:
    """Return the voxels and walls of the file beside a map; none where there is no such file."""
    if not file.is_file():
        return np.zeros((0, 3)), np.zeros((0, 2))
    try:
        with np.load(file) as stored:
            cloud, walls = stored["cloud"].astype(np.float64), stored["walls"].astype(np.float64)
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise ConfigError(f"The voxels of the map, '{file}', cannot be read: {error}.") from error
    for points, width in ((cloud, 3), (walls, 2)):
        if points.ndim != 2 or points.shape[1] != width or not np.isfinite(points).all():
            raise ConfigError(f"The voxels of the map, '{file}', are no (n, {width}) finite points.")
    return cloud, walls


def _image(file: Path) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Return the grey of an image, whose brightest is 255, and which pixels are opaque."""
    try:
        with Image.open(file, formats=_KINDS) as image:
            if image.mode.startswith("I"):
                grey = np.round(np.asarray(image, float) / 257.0)
                return grey.astype(np.uint8), np.ones(grey.shape, bool)
            pixels = np.asarray(image.convert("RGBA"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise ConfigError(f"The image of the map, '{file}', cannot be read; it is a PGM, PNG or BMP file.") from error
    return np.round(pixels[..., :3] @ _LUMA).astype(np.uint8), pixels[..., 3] == 255


def _cells(image: NDArray[np.uint8], negate: bool, occupied: float, free: float, mode: str) -> NDArray[np.int8]:
    """Return the cells of an opaque image, in single precision as Nav2 has it."""
    value = image[::-1].astype(np.float32)
    if mode == "raw":
        return np.where(value <= 100.0, value, -1.0).astype(np.int8)
    value /= np.float32(255.0)
    share = value if negate else np.float32(1.0) - value
    low, high = np.float32(free), np.float32(occupied)
    between = np.full(value.shape, -1.0, np.float32)
    if mode == "scale":
        between = np.floor((share - low) / np.maximum(high - low, np.float32(1e-9)) * np.float32(100.0) + 0.5)
    # 205 is the byte of unknown, though its share is 0.19608, just above 0.196.
    return np.where(share <= low, 0.0, np.where(share >= high, 100.0, between)).astype(np.int8)


def _finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _number(file: Path, facts: dict[str, Any], key: str, default: float | None) -> float:
    value = facts.get(key, default)
    if not _finite(value):
        raise ConfigError(f"The map '{file}' has the {key} {value}; it is a number.")
    return float(value)
