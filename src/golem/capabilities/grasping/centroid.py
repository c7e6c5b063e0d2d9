"""The paper's `Centroid`: close on the centre of the object as the head camera saw it once, top-down or forward."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.capabilities.grasping.base import Grasp, Gripper, OpenLoop
from golem.capabilities.grasping.object_cloud import height_above_ground
from golem.finite import check_finite
from golem.types import Array, LocalizedObject


@dataclass(frozen=True)
class CentroidConfig:
    """Where around the object the fingers close.

    Attributes:
        depth: how far below the seen surface point the fingertips go at most [m]: a flange head is 5-7 mm high, and
            the pads shall cover it.
        clearance: height of the fingertips above the ground around the object [m]; with the hand tilted by 5 deg
            the lower finger of a 50 mm opening is 2 mm below the middle.
        gap: opening to arrive with [m]: room for +-20 mm of error, and the fingertips still advance by less than
            2 mm while they close from there (parallelogram linkage).
        reach: how far beyond the seen surface the fingertips go when the hand comes across [m]: past the middle of a
            handle of 25 mm.
        wide: opening to arrive with then [m]: a bar has more room around it than a screw.
    """

    depth: float = 0.010
    clearance: float = 0.004
    gap: float = 0.050
    reach: float = 0.020
    wide: float = 0.090


UP: Array = np.array([0.0, 0.0, 1.0])
"""(3,) vertical in odom."""
ACROSS = 0.7
"""Vertical part of the unit approach below which a hand looks across."""


def grasp_pose(position: Array, yaw: float, normal: Array = UP) -> Array:
    """Return the (4, 4) gripper pose at `position` (3,) that looks against `normal`.

    The gripper's z (approach) is -`normal` (3,), of unit length; its x axis is as near to the heading `yaw` about the
    vertical [rad] as that allows. A hand that looks across rather than down has its x axis down: that is how the wrist
    holds it when the forearm points forward, and its fingers close sideways.
    """
    x = np.array([math.cos(yaw), math.sin(yaw), 0.0]) if abs(normal[2]) > ACROSS else -UP
    x -= (x @ normal) * normal
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, 0] = x
    (a, b, c), (u, v, w) = (-normal).tolist(), x.tolist()
    T[:3, 1] = b * w - c * v, c * u - a * w, a * v - b * u  # np.cross takes twenty times as long
    T[:3, 2] = -normal
    T[:3, 3] = position
    return T


def grasp_depth(target: LocalizedObject, depth: float, clearance: float) -> float:
    """Return how far below the top of `target` the fingertips shall go [m].

    That is `depth`, or less where the ground around the object (the lowest tenth of its cloud) is so near that less
    than `clearance` would be left [m]; never less than a third of `depth`.
    """
    height = height_above_ground(target)
    return depth if height is None else float(np.clip(height - clearance, depth / 3.0, depth))


class Centroid(OpenLoop):
    """One grasp on the object's centre, along the approach that the task wants, down or forward; see `GraspMethod`."""

    latency = 0.0  # a proposal takes a few microseconds

    def __init__(self, config: CentroidConfig | None = None) -> None:
        self.config = config or CentroidConfig()

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        check_finite("the object's position", target.position)
        down = gripper.approach[2] < -ACROSS
        depth = grasp_depth(target, self.config.depth, self.config.clearance) if down else self.config.reach
        pose = grasp_pose(target.position + depth * gripper.approach, gripper.yaw, -gripper.approach)
        return [Grasp(pose, self.config.gap if down else self.config.wide, target.detection.score)]
