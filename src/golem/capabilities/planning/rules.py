"""Rules that every posture of a way has to keep besides being free; any number of them may be given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.capabilities.planning import plan_kernel
from golem.errors import ConfigError
from golem.types import Array, Side

PAPER_BOX = ((0.0, -0.45, -0.05), (0.60, 0.45, 0.60))
"""Opposite corners of the box that the paper keeps both hands in, in base_link [m]; it names no bound behind."""


@dataclass(frozen=True, slots=True)
class HandBox:
    """The grasp frame of a hand stays within a box, whose opposite corners in base_link are `lower`, `upper` [m]."""

    side: Side
    lower: tuple[float, float, float] = PAPER_BOX[0]
    upper: tuple[float, float, float] = PAPER_BOX[1]

    def __post_init__(self) -> None:
        if not all(a < b for a, b in zip(self.lower, self.upper, strict=True)):
            raise ConfigError("The lower corner of a hand's box lies below the upper one in x, y and z.")

    def row(self, body: int, T_body_gripper: Array, com: Array) -> Array:
        """Return the rule as `plan_kernel` reads it; see `Rule`."""
        return _row(plan_kernel.IN_BOX, body, *T_body_gripper[:3, 3], *self.lower, *self.upper)

    def __str__(self) -> str:
        return f"the {self.side} hand stays within its box"


@dataclass(frozen=True, slots=True)
class HandUpright:
    """The approach axis of a hand, z, stays near a direction.

    Attributes:
        angle: how far it may turn away [rad].
        axis: the direction in base_link; straight down unless said otherwise.
    """

    side: Side
    angle: float
    axis: tuple[float, float, float] = (0.0, 0.0, -1.0)

    def __post_init__(self) -> None:
        if not (0.0 < self.angle <= np.pi and np.linalg.norm(self.axis) > 0.0):
            raise ConfigError("A hand is kept within an angle of 0 to pi of an axis that is not zero.")

    def row(self, body: int, T_body_gripper: Array, com: Array) -> Array:
        """Return the rule as `plan_kernel` reads it; see `Rule`."""
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        return _row(plan_kernel.ALONG_AXIS, body, *T_body_gripper[:3, 2], *axis, float(np.cos(self.angle)))

    def __str__(self) -> str:
        return f"the {self.side} hand stays within {np.rad2deg(self.angle):.0f} deg of its axis"


@dataclass(frozen=True, slots=True)
class Balanced:
    """The centre of mass of a robot on its feet stays where it is at the start, across to within `shift` [m]."""

    shift: float = 0.04

    def __post_init__(self) -> None:
        if not self.shift > 0.0:
            raise ConfigError("The centre of mass may move by a positive distance.")

    def row(self, body: int, T_body_gripper: Array, com: Array) -> Array:
        """Return the rule as `plan_kernel` reads it; see `Rule`."""
        return _row(plan_kernel.BALANCED, 0, *com[:2], self.shift)

    def __str__(self) -> str:
        return f"the centre of mass moves by {self.shift * 1e3:.0f} mm at most"


Rule = HandBox | HandUpright | Balanced
"""What a way may have to keep. `row(body, T_body_gripper, com)` returns it as (12,) numbers for the kernel, given the
body that carries the hand, the (4, 4) grasp frame in it and the (3,) centre of mass at the start in base_link."""


def _row(kind: int, body: int, *numbers: float) -> Array:
    row = np.zeros(plan_kernel.ROW)
    row[0], row[1], row[2 : 2 + len(numbers)] = kind, body, numbers
    return row
