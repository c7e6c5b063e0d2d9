"""The paper's `Centroid`: close, top-down, on the centre of the object as the head camera saw it once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.skills.grasping.base import Grasp, OpenLoop
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
    """

    depth: float = 0.0115
    clearance: float = 0.003
    gap: float = 0.050


def top_down(position: Array, yaw: float) -> Array:
    """Return the (4, 4) gripper pose at `position` (3,) that points straight down.

    The gripper's z (approach) is -z of odom; its x axis has the heading `yaw` about the vertical [rad].
    """
    c, s = math.cos(yaw), math.sin(yaw)
    T = np.eye(4)
    T[:3, 0] = (c, s, 0.0)
    T[:3, 1] = (s, -c, 0.0)
    T[:3, 2] = (0.0, 0.0, -1.0)
    T[:3, 3] = position
    return T


def grasp_depth(target: LocalizedObject, depth: float, clearance: float) -> float:
    """Return how far below the top of `target` the fingertips shall go [m].

    That is `depth`, or less where the ground around the object (the lowest tenth of its cloud) is so near that less
    than `clearance` would be left [m]; never less than a third of `depth`.
    """
    if len(target.points) == 0:
        return depth
    ground = float(np.quantile(target.points[:, 2], 0.1))
    height = float(target.position[2]) - ground
    return float(np.clip(height - clearance, depth / 3.0, depth))


class Centroid(OpenLoop):
    """One grasp, straight down on the object's centre."""

    def __init__(self, config: CentroidConfig | None = None) -> None:
        """Take the distances from `config`."""
        self.config = config or CentroidConfig()

    def propose(self, target: LocalizedObject, yaw: float) -> list[Grasp]:
        """Return the one top-down grasp; see `GraspMethod`."""
        depth = grasp_depth(target, self.config.depth, self.config.clearance)
        position = target.position - (0.0, 0.0, depth)
        return [Grasp(top_down(position, yaw), self.config.gap, target.detection.score)]
