"""Where a hand that points straight down can be, and how well the arm stands there: a grid that skills ask."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from golem.errors import ConfigError
from golem.output_file import write_file
from golem.types import Array, Side

FORMAT = "golem-reach-1"
H12_REACH = Path(__file__).with_name("h12_reach.json")
"""The map of the H1-2 with MAGPIE hands; `golem reach --out FILE` makes it."""


@dataclass(frozen=True, slots=True)
class ReachMap:
    """A grid over base_link for the right hand; the left hand's is its mirror image.

    A point is served where a posture puts the grasp frame there, straight down and within the gate's range, in which
    the robot does not touch itself.

    Attributes:
        origin: (3,) the first point of the grid in base_link [m].
        spacing: between its points [m].
        yaw: heading of the gripper's x axis [rad].
        margin: (x, y, z) distance of the arm's joints from the nearest bound of the gate [rad]; negative where the
            point is not served.
        com_shift: (x, y, z) how far the robot's centre of mass moves across, from the posture `home` [m].
    """

    origin: Array
    spacing: float
    yaw: float
    margin: Array
    com_shift: Array

    def points(self) -> Array:
        """Return (x, y, z, 3) the points of the grid in base_link [m]."""
        index = np.stack(np.meshgrid(*(np.arange(k) for k in self.margin.shape), indexing="ij"), axis=-1)
        return self.origin + self.spacing * index

    def served(self) -> NDArray[np.bool_]:
        """Return (x, y, z) which points are served."""
        return self.margin >= 0.0

    def serves(self, side: Side, position: Array) -> bool:
        """Return whether a hand can be at `position` (3,) in base_link [m], as far as the nearest point says."""
        index = self._index(side, position)
        return index is not None and bool(self.margin[index] >= 0.0)

    def comfort(self, side: Side, position: Array) -> float:
        """Return the margin at the point nearest to `position` (3,) in base_link [rad]; negative out of reach."""
        index = self._index(side, position)
        return -1.0 if index is None else float(self.margin[index])

    def _index(self, side: Side, position: Array) -> tuple[int, ...] | None:
        p = np.asarray(position, float) * (1.0, 1.0 if side == "right" else -1.0, 1.0)
        if not np.isfinite(p).all():
            return None
        index = np.rint((p - self.origin) / self.spacing).astype(int)
        inside = (index >= 0).all() and (index < self.margin.shape).all()
        return tuple(int(i) for i in index) if inside else None


def save_map(reach: ReachMap, file: Path) -> None:
    """Write the JSON file: mrad and mm, -1 where a point is not served. Raises OutputError: it cannot be written."""
    margin = np.where(reach.served(), np.floor(1e3 * reach.margin), -1).astype(int)
    shift = np.where(reach.served(), np.rint(1e3 * reach.com_shift), -1).astype(int)
    data = {
        "format": FORMAT,
        "origin": reach.origin.round(6).tolist(),
        "spacing": reach.spacing,
        "yaw": reach.yaw,
        "shape": list(reach.margin.shape),
        "margin_mrad": margin.ravel().tolist(),
        "com_shift_mm": shift.ravel().tolist(),
    }
    write_file(file, json.dumps(data, separators=(",", ":")) + "\n")


@functools.cache
def load_map(file: Path = H12_REACH) -> ReachMap:
    """Read a file of `save_map`. Raises ConfigError: it cannot be read, or is no such file."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
        if data["format"] != FORMAT:
            raise ValueError(f"format {data['format']}")
        shape = tuple(data["shape"])
        margin, shift = (np.array(data[k], float).reshape(shape) for k in ("margin_mrad", "com_shift_mm"))
        return ReachMap(
            np.array(data["origin"], float), float(data["spacing"]), float(data["yaw"]),
            np.where(margin < 0, -1.0, 1e-3 * margin), np.where(margin < 0, 0.0, 1e-3 * shift),
        )  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"Cannot read '{file}' as a map of reach ({error}); `golem reach --out FILE` writes one."
        ) from error
