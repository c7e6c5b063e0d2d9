"""By how much a palm camera sees things elsewhere than the head camera, and a hand comes elsewhere than it is sent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from golem.skills.context import Context
from golem.skills.pick_targets import positions
from golem.types import Array, Side

FARTHEST: Array = np.array([0.1, 0.1, 0.05])
"""Farthest that a palm camera may be off along x, y, z [m]: each camera is off by centimetres."""
SPREAD = 0.01
"""How well one look agrees with a list, turned by what the head camera is off by [m]."""
LIKELY = 0.15
"""An offset this large costs half a thing that agrees [m]."""
CLEAR = 0.4
"""By how many things that agree an offset must be better than every other one."""
APART = 0.02
"""Offsets this far apart are others [m]."""
LOOK = 1.0
"""Time for one look [s]."""
SURE = 0.02
"""Up to here a difference along a row is no mistaken neighbour [m]; screws stand 9 cm apart."""
ARRIVED, INTEGRAL, DROOP = 0.004, 2.5, 0.012
"""A hand sent this near to its goal arrives, and what holds it off is integrated [m]; how fast [1/s], how far [m]."""
PAST, SLOWER = 0.003, 0.5
"""A hand this far beyond its goal has come past it [m]; what the integral's speed is multiplied by then [own]."""


async def learn_offset(context: Context, side: Side, names: Sequence[str], known: Array) -> Array | None:
    """Look down with a hand; return its `hand_offset` against `known` (n, 3), where the head camera has a list."""
    with context.watch(f"{side}_hand", *names, doubtful=tuple(names)) as eye:
        sightings = await eye.look(LOOK)
    return None if sightings is None else hand_offset(positions(sightings, names), known)


def hand_offset(seen: Array, known: Array) -> Array | None:
    """Return (3,) by how much `seen` (m, 3) is elsewhere than `known` (n, 3), in odom [m]; None where that is unclear.

    Fasteners stand nearer to each other than a camera is off, so one alone may be its neighbour. The offset counts by
    which the most of what is seen falls on what is known; it is unclear by less than two, or where another offset does
    as well, as in a regular row.
    """
    offsets = (seen[:, None] - known[None]).reshape(-1, 3)
    offsets = offsets[(np.abs(offsets) <= FARTHEST).all(axis=1)]
    if len(seen) < 2 or not len(offsets):
        return None
    left = seen[None, :, None] - offsets[:, None, None] - known[None, None]
    away = np.linalg.norm(left, axis=3).min(axis=2)
    scores = np.exp(-0.5 * (away / SPREAD) ** 2).sum(axis=1) - 0.5 * (np.linalg.norm(offsets, axis=1) / LIKELY) ** 2
    best = int(scores.argmax())
    others = scores[np.linalg.norm(offsets - offsets[best], axis=1) > APART]
    agree = away[best] < 2.0 * SPREAD
    if agree.sum() < 2 or (len(others) and others.max() > scores[best] - CLEAR):
        return None
    nearest = np.linalg.norm(left[best], axis=2).argmin(axis=1)
    return (seen - known[nearest])[agree].mean(axis=0)


def shift_of(seen: Array, expected: Array, others: Array) -> Array:
    """Return by how much a hand misses what the head camera shows, to send it elsewhere by the same.

    Head camera and encoders are off by centimetres, and the palm camera tells by how much at the object that was
    taken. What looks alike in a row may be mistaken for its neighbour. So what the difference has in the direction
    of the nearest of `others` counts only up to `SURE`.

    Args:
        seen: (3,) where the palm camera saw the object, in odom [m].
        expected: (3,) where the head camera did.
        others: (n, 3) where the head camera saw such objects, this one included.
    """
    shift = seen - expected
    away = others - expected
    distance = np.linalg.norm(away, axis=1)
    apart = distance > 1e-6
    if not apart.any():
        return shift
    k = int(np.argmin(np.where(apart, distance, np.inf)))
    direction = away[k] / distance[k]
    along = float(shift @ direction)
    return shift - along * direction if abs(along) > SURE else shift


class Droop:
    """How far beside its goal a hand is sent, so that it comes there as measured, across its approach.

    Errors of torques and friction hold an arm by millimetres off where it is sent, and the servo closes within 3 mm.
    The integral of what is left makes up for that. A late arm with friction swings around its goal by it, and goes up
    and down meanwhile: whenever the hand has come past its goal, the integral is slowed down.
    """

    def __init__(self) -> None:
        """Begin with a hand that is sent to its goal."""
        self._sent, self._gain, self._left = np.zeros(3), INTEGRAL, np.zeros(3)

    def __call__(self, T_goal: Array, T_sent: Array, T_now: Array, dt: float) -> Array:
        """Return (3,) by how much beside its goal the hand is to be sent, in odom [m].

        Args:
            T_goal, T_sent, T_now: (4, 4) the goal, where the hand was sent, and the measured hand.
            dt: time since the last call [s].
        """
        across = np.eye(3) - np.outer(T_goal[:3, 2], T_goal[:3, 2])
        if np.linalg.norm(across @ (T_goal[:3, 3] + self._sent - T_sent[:3, 3])) < ARRIVED:
            left = across @ (T_goal[:3, 3] - T_now[:3, 3])
            if np.linalg.norm(left) > PAST:
                self._gain *= SLOWER if left @ self._left < 0.0 else 1.0
                self._left = left
            self._sent = self._sent + self._gain * dt * left
        self._sent *= min(1.0, DROOP / max(float(np.linalg.norm(self._sent)), 1e-9))
        return self._sent
