"""Finds the joint that was moved by hand, and which way, in the states of a robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from golem.types import NUM_JOINTS, Array, LowState

ENOUGH = 0.12
"""Angle from which a joint counts as moved by hand [rad]: half the range of the ankle's roll."""
ALONE = 2.0
"""How many times as far as any other it has to have moved."""


@dataclass(frozen=True, slots=True)
class HandMove:
    """A joint that was moved.

    Attributes:
        joint: its index.
        angle: by how much its position changed [rad].
        integral: by how much its speed says that it did [rad].
    """

    joint: int
    angle: float
    integral: float


def hand_move(states: Sequence[LowState], start: Array) -> HandMove | None:
    """Return the joint that has moved from `start` alone, once one has.

    Args:
        states: since then, oldest first.
        start: (27,) joints before the motion [rad].

    Returns:
        None while none has moved by `ENOUGH`, or another more than half as far.
    """
    if len(states) < 2:
        return None
    moved = states[-1].q - start
    order = np.argsort(np.abs(moved))
    first, second = int(order[-1]), int(order[-2])
    if abs(moved[first]) < max(ENOUGH, ALONE * abs(moved[second])):
        return None
    t = np.array([s.t for s in states])
    speed = np.array([s.dq[first] for s in states])
    return HandMove(first, float(moved[first]), float(np.trapezoid(speed, t)))


def wrong_with(move: HandMove, wanted: int, positive: bool, names: Sequence[str]) -> str:
    """Return what is wrong with what was reported of a joint that a person moved; empty if nothing is.

    Args:
        move: what the robot reported.
        wanted: index of the joint that the person moved.
        positive: whether in its positive direction.
        names: of the `NUM_JOINTS` joints.
    """
    assert len(names) == NUM_JOINTS
    if move.joint != wanted:
        return f"{names[wanted]} was moved, and {names[move.joint]} reports it: the joint order is another"
    if (move.angle > 0.0) != positive:
        direction = "positive" if positive else "negative"
        return f"{names[wanted]} was moved in its {direction} direction and reports {move.angle:+.2f} rad: wrong sign"
    if abs(move.integral - move.angle) > 0.5 * abs(move.angle):
        return f"{names[wanted]} moved by {move.angle:.2f} rad, and its speed says {move.integral:+.2f} rad"
    return ""
