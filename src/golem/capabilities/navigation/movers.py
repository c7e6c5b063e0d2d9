"""Who walks about near the robot, and where they will be in the next moments, from the points of scans alone.

Points are put together to blobs, blobs of the size of a person are followed from scan to scan, and each gets the
velocity of the line through its last places. Nothing is known of whom they mean to go to: straight on is assumed.

Of what stands, a moving robot sees another part in every scan. Such a blob grows at one edge, or shrinks at the other,
while both edges of somebody who walks go along; and it jumps about more than it goes.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import cv2
import numpy as np

from golem.types import Array

CELL = 0.12
"""Side of the cells in which points are put together [m]: neighbouring cells are of one blob."""
SIZE = (0.1, 1.1)
"""Extent of a blob that may be a person, the larger of both directions [m]."""
FEWEST = 6
"""Points of a blob."""
REACH = 5.0
"""Distance from the robot up to which blobs are followed [m]."""
GATE = 0.4
"""Distance of a blob from where one is expected within which it is that one [m]."""
LOST = 0.35
"""Time after which a blob that is not seen is forgotten [s]."""
BODY = 0.25
"""Radius of a person [m]; a scan shows one side alone."""
HISTORY, ENOUGH = 6, 4
"""Places of a blob that are kept, and from how many on it has a velocity."""
WALKS = (0.3, 2.5)
"""Speeds of somebody who walks [m/s]: less is noise, more is a mistake."""
EDGES = 0.7
"""Share of the speed of a blob's middle with which the slower of its edges has to go along."""
SURE = 5.0
"""Standard errors of the speed by which it has to be above zero."""


@dataclass
class _Blob:
    """Something that is followed.

    Attributes:
        places: time [s], lowest and highest x, y of it [m], the newest last.
        middle: (2,) of the newest of them [m].
        points: (n, 2) of the newest scan that showed it [m].
        velocity: (2,) [m/s]; zero while it is not known.
    """

    places: deque[tuple[float, ...]] = field(default_factory=lambda: deque(maxlen=HISTORY))
    middle: Array = field(default_factory=lambda: np.zeros(2))
    points: Array = field(default_factory=lambda: np.zeros((0, 2)))
    velocity: Array = field(default_factory=lambda: np.zeros(2))

    def take(self, t: float, points: Array) -> None:
        low, high = points.min(axis=0), points.max(axis=0)
        self.places.append((t, *low.tolist(), *high.tolist()))
        self.middle, self.points = 0.5 * (low + high), points
        if len(self.places) >= ENOUGH:
            self.velocity = _velocity(np.array(self.places))

    def expected(self, t: float) -> Array:
        """Return the (2,) place at time `t` [m]."""
        return self.middle + (t - self.places[-1][0]) * self.velocity


class Movers:
    """Follows blobs; all points are in one frame."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Know of nobody again."""
        self._blobs: list[_Blob] = []

    def update(self, t: float, points: Array, here: tuple[float, float]) -> None:
        """Take a scan of time `t` [s] with `points` (n, 2) at heights of a person [m]; the robot is `here` [m]."""
        self._blobs = [blob for blob in self._blobs if 0.0 < t - blob.places[-1][0] < LOST]
        free = list(self._blobs)
        near = points[((points - here) ** 2).sum(axis=1) < REACH**2]
        for part in _blobs(near):
            middle = 0.5 * (part.min(axis=0) + part.max(axis=0))
            away = np.hypot(*(np.array([blob.expected(t) for blob in free]).reshape(-1, 2) - middle).T)
            if len(away) and away.min() < GATE:
                free.pop(int(away.argmin())).take(t, part)
            else:
                blob = _Blob()
                blob.take(t, part)
                self._blobs.append(blob)

    def people(self, t: float) -> Array:
        """Return (k, 5) those who walk at time `t` [s]: place [m], velocity [m/s] and radius [m]; see `rollout`."""
        rows: list[tuple[float, ...]] = []
        for blob in self._blobs:
            if blob.velocity.any():
                radius = max(BODY, 0.5 * float(np.ptp(blob.points, axis=0).max()))
                rows.append((*blob.expected(t), *blob.velocity, radius))
        return np.array(rows).reshape(-1, 5)

    def ahead(self, horizon: float, step: float = 0.2) -> Array:
        """Return (m, 2) where those who walk will be within `horizon` [s], every `step` [s], in m."""
        walking = [blob for blob in self._blobs if blob.velocity.any()]
        times = np.arange(step, horizon + 1e-9, step)
        swept = [blob.points + dt * blob.velocity for blob in walking for dt in times]
        return np.concatenate(swept) if swept else np.zeros((0, 2))


def _velocity(rows: Array) -> Array:
    """Return the (2,) velocity of what `rows` of `_Blob.places` show [m/s]; zero where only another part was seen."""
    t = rows[:, 0] - rows[:, 0].mean()
    spread = float(t @ t)
    slopes = (t @ rows[:, 1:] / spread).reshape(2, 2)
    velocity: Array = slopes.mean(axis=0)
    speed = float(np.hypot(*velocity))
    if not WALKS[0] < speed < WALKS[1]:
        return np.zeros(2)
    way = velocity / speed
    along = 0.5 * (rows[:, 1:3] + rows[:, 3:]) @ way
    rest = along - along.mean() - speed * t
    error = math.sqrt(float(rest @ rest) / (len(t) - 2) / spread)
    walks = float((slopes @ way).min()) > EDGES * speed and speed > SURE * error
    return velocity if walks else np.zeros(2)


def _blobs(points: Array) -> list[Array]:
    """Return the points (n, 2) of each blob of the size of a person."""
    if len(points) < FEWEST:
        return []
    cells = np.floor((points - points.min(axis=0)) / CELL).astype(int)
    full = np.zeros(cells.max(axis=0) + 1, np.uint8)
    full[cells[:, 0], cells[:, 1]] = 1
    count, labels = cv2.connectedComponents(full, connectivity=8)
    label = np.asarray(labels)[cells[:, 0], cells[:, 1]]
    order = np.argsort(label, kind="stable")
    parts = np.split(points[order], np.searchsorted(label[order], np.arange(2, count)))
    return [p for p in parts if len(p) >= FEWEST and SIZE[0] <= float(np.ptp(p, axis=0).max()) <= SIZE[1]]
