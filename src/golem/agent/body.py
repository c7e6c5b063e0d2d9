"""What the desk works with: a robot whose skills can be begun and cancelled, and looked at meanwhile."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.interfaces.payloads import Feedback
from golem.skills.base import SkillResult
from golem.skills.spec import SkillSpec

RESOURCES = {
    "state": "Where the robot is and how it moves, its joints, hands and what they feel.",
    "safety": "State of the safety gate, and why.",
    "map": "The map of the floor as text: # occupied, . free, ? unknown; first row at the greatest y.",
    "memory": "What is remembered: kinds of things, where, and how long ago they were seen.",
    "inventory": "What became of each fastener of the jobs that are kept.",
}
"""What can be read, by name; each is JSON."""
CAMERAS = ("head", "left_hand", "right_hand")
MAP_CELLS = 120
"""Cells of a map's longer side that are told [own]: a model reads ten thousand characters, not a million."""


@dataclass(frozen=True, slots=True)
class Moment:
    """How the robot moves now.

    Attributes:
        x, y: of base_link in odom [m].
        velocity: of base_link in odom [m/s].
        forces: of the left and the right hand on the world, in their grasp frames: (2, 3) [N].
    """

    x: float
    y: float
    velocity: tuple[float, float]
    forces: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Picture:
    """What a camera showed: a JPEG, and what was found in it, by label, score and x, y, z in odom [m]."""

    jpeg: bytes
    found: tuple[tuple[str, float, float, float, float], ...]


class Body(Protocol):
    """A robot with its stack, in this process or on a domain. One thread calls all of it.

    Attributes:
        specs: its skills.
        t: robot time [s].
        busy: whether a skill runs.
        paced: whether time passes by itself.
    """

    specs: Mapping[str, SkillSpec]
    paced: bool

    @property
    def t(self) -> float:
        """See above."""
        ...

    @property
    def busy(self) -> bool:
        """See above."""
        ...

    def begin(self, skill: str, fields: Mapping[str, Any]) -> None:
        """Begin a skill; raises `GolemError` where it cannot."""
        ...

    def said(self) -> Feedback | None:
        """Return what the skill has said since the last time, if anything."""
        ...

    def result(self) -> SkillResult | None:
        """Return how the skill that was begun last has ended; None while it runs. Its value is a dataclass or JSON."""
        ...

    def cancel(self) -> None:
        """Cancel the skill that runs."""
        ...

    def stop_motors(self) -> None:
        """Ask the safety gate for a stop."""
        ...

    def moment(self) -> Moment | None:
        """Return how the robot moves now; None before it reports."""
        ...

    def in_odom(self, frame: str, x: float, y: float) -> tuple[float, float] | None:
        """Return a place given in a frame, in odom [m]; None where that is not known."""
        ...

    def read(self, resource: str) -> dict[str, Any]:
        """Return one of `RESOURCES`; words from the world in it are marked."""
        ...

    def picture(self, camera: str) -> Picture | None:
        """Return what a camera shows, as of its newest frame; None where none came."""
        ...

    def step(self) -> None:
        """Let a little time pass."""
        ...


def drawn(rgb: NDArray[np.uint8], boxes: Sequence[tuple[str, Sequence[float]]]) -> bytes:
    """Return a JPEG of a picture (h, w, 3) with boxes around what was found, each x_min, y_min, x_max, y_max [px]."""
    picture = np.ascontiguousarray(rgb[:, :, ::-1])
    for label, (x0, y0, x1, y1) in boxes:
        cv2.rectangle(picture, (round(x0), round(y0)), (round(x1), round(y1)), (0, 196, 255), 2)
        cv2.putText(picture, label[:20], (round(x0), round(y0) - 4), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 196, 255), 1)
    return cv2.imencode(".jpg", picture)[1].tobytes()


def map_text(cells: NDArray[np.int8]) -> str:
    """Return a map (h, w) of 0 to 100, -1 unknown, as text; of cells that are put together the most occupied counts."""
    step = math.ceil(max(cells.shape) / MAP_CELLS)
    h, w = (step * (n // step) for n in cells.shape)
    most = cells[:h, :w].reshape(h // step, step, w // step, step).max(axis=(1, 3))
    letters = np.where(most < 0, "?", np.where(most > 50, "#", "."))
    return "\n".join("".join(row) for row in letters[::-1])
