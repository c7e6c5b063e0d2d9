"""Where a door's handle goes: the door behind it as the camera shows it, and the circle that the hand finds out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.capabilities.grasping.object_cloud import spaced, support_plane, thinned
from golem.types import Array

AROUND = (0.7, 0.20)
"""How far beside and above or below a handle its door is looked for [m]."""
UPRIGHT = 0.3
"""Vertical part of the unit normal below which a plane is a door."""
BIN, GAP = 0.02, 3
"""Width of the strips into which a door is cut [m], and how many empty ones end it."""
ARM = (0.45, 0.85)
"""Distances of a hinge from its handle that occur [m]."""
USUAL = 0.52
"""The distance that is supposed where less of the door is seen [m]."""
THICK = 0.05
"""How far behind a door's face its hinge is [m]."""
SIGMA = (0.10, 0.03)
"""How well the hinge is known before the door moves, along the door and across it [m]."""
NOISE = 0.012
"""How far a hand that holds a bar seems to be from the circle [m]: a robot in a hoist sways, and does not know it."""
TELLING = 0.05
"""Distance from the start from which on a place tells of the circle [m]: before, sway is all there is to see."""


@dataclass(frozen=True, slots=True)
class Door:
    """The door that a handle is on.

    Attributes:
        normal: (2,) horizontal unit vector out of the door, towards the robot, in odom.
        hinge: (2,) where its hinge is supposed to be [m].
    """

    normal: Array
    hinge: Array


def door_behind(handle: Array, scene: Array) -> Door | None:
    """Return the door behind a handle, (3,) a point of it, by the `scene` (n, 3) of a camera, both in odom [m].

    The hinge is where the door ends, on the side on which it ends later; a door that leaves the picture is at least as
    wide as is seen. None: the camera shows no upright plane there.
    """
    off = np.abs(scene - handle)
    near = scene[(off[:, :2] < AROUND[0]).all(axis=1) & (off[:, 2] < AROUND[1])]
    if len(near) < 100:
        return None
    near = spaced(thinned(near, 20000), 0.01)
    plane = support_plane(near, handle)
    if plane is None or abs(plane[0][2]) > UPRIGHT:
        return None
    normal, offset = plane
    flat = normal[:2] / np.linalg.norm(normal[:2])
    along = np.array([-flat[1], flat[0]])  # to the left of one who looks out of the door
    on = near[np.abs(near @ normal - offset) < 0.01]
    strips = np.floor((on[:, :2] - handle[:2]) @ along / BIN).astype(int)
    left, right = _extent(set(strips.tolist()), 1), _extent(set(strips.tolist()), -1)
    side = along if left > right else -along
    arm = min(max(left, right, USUAL), ARM[1])
    behind = float(handle @ normal - offset) + THICK
    return Door(flat, handle[:2] + arm * side - behind * flat)


def _extent(strips: set[int], step: int) -> float:
    """Return how far a door goes on to one side without a gap [m]."""
    last = k = 0
    while k - last < GAP if step > 0 else last - k < GAP:
        k += step
        if k in strips:
            last = k
    return abs(last) * BIN


class DoorArc:
    """The circle about an upright hinge, by now at `hinge` (2,) [m], on which a held handle moves.

    Least squares on the places of the hand, each as far from the hinge as all are in the mean, with what the camera
    said of the hinge as a prior. The first centimetres do not count: arm and fingers give until the seal lets go.
    """

    def __init__(self, start: Array, door: Door) -> None:
        """Begin where the hand holds the handle, at `start` (3,) in odom [m]."""
        self.hinge = door.hinge.copy()
        self._start, self._normal, self._prior = start[:2].copy(), door.normal, door.hinge.copy()
        self._places: list[Array] = []
        axes = np.column_stack([np.array([-door.normal[1], door.normal[0]]), door.normal])
        self._weight = axes @ np.diag(1.0 / np.square(SIGMA)) @ axes.T
        arm = self._start - self.hinge
        # The turn that brings the handle out of the door.
        self._sense = 1.0 if -arm[1] * door.normal[0] + arm[0] * door.normal[1] > 0.0 else -1.0

    def add(self, place: Array) -> None:
        """Take in where the hand is, (3,) in odom [m]; near the start it tells nothing."""
        if np.linalg.norm(place[:2] - self._start) < TELLING:
            return
        self._places.append(place[:2].copy())
        for _ in range(4):
            self._step()
        arm = self.hinge - self._start
        size = float(np.linalg.norm(arm))
        self.hinge = self._start + arm * (np.clip(size, *ARM) / size)

    def _step(self) -> None:
        to_each = self.hinge - np.array(self._places)
        each = np.linalg.norm(to_each, axis=1)
        residual = (each - each.mean()) / NOISE
        unit = to_each / each[:, None]
        J = (unit - unit.mean(axis=0)) / NOISE
        A = J.T @ J + self._weight
        b = J.T @ residual + self._weight @ (self.hinge - self._prior)
        self.hinge = self.hinge - np.linalg.solve(A, b)

    @property
    def arm(self) -> float:
        """Distance of the handle from the hinge [m]."""
        return float(np.linalg.norm(self._start - self.hinge))

    def angle(self, place: Array) -> float:
        """Return how far the door is open when the hand is at `place` (3,) [rad]."""
        a, b = self._start - self.hinge, place[:2] - self.hinge
        return self._sense * math.atan2(a[0] * b[1] - a[1] * b[0], float(a @ b))

    def pose(self, T_start: Array, angle: float, turn: float = 1.0) -> Array:
        """Return the (4, 4) pose of a hand that held the handle at `T_start` when the door is open by `angle` [rad].

        Args:
            T_start: (4, 4) where it was when the door was shut.
            angle: how far the door is open [rad].
            turn: share of the door's turn that the hand takes part in; a round bar lets it keep its heading.
        """
        out = T_start.copy()
        out[:2, 3] = self.hinge + _turn(self._sense * angle) @ (T_start[:2, 3] - self.hinge)
        R = np.eye(3)
        R[:2, :2] = _turn(self._sense * angle * turn)
        out[:3, :3] = R @ T_start[:3, :3]
        return out


def _turn(angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])
