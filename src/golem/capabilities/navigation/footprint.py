"""The room a robot takes up on the floor, with its arms where they are and whatever it carries."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from golem.types import Array, PlanarPose

SAMPLE = 0.05
"""Distance between the places at which a footprint is compared with a map [m]."""


@dataclass(frozen=True, slots=True)
class Footprint:
    """A convex polygon in base_link.

    Attributes:
        corners: (n, 2) counter-clockwise [m].
        samples: (m, 2) places on its edges and inside [m].
        radius: of the largest circle around base_link that is inside: the robot turns within it [m].
        reach: of the smallest one around base_link that it is inside of [m].
    """

    corners: Array
    samples: Array
    radius: float
    reach: float

    @classmethod
    def around(cls, balls: Array, margin: float = 0.0) -> Footprint:
        """Return the footprint, wider by `margin` [m], of `balls` (n, 4): centre in base_link and radius [m]."""
        turns = np.linspace(0.0, math.tau, 12, endpoint=False)
        circle = np.column_stack([np.cos(turns), np.sin(turns)])
        points = (balls[:, None, :2] + (balls[:, 3, None, None] + margin) * circle).reshape(-1, 2)
        return cls.of(points[ConvexHull(points).vertices])

    @classmethod
    def of(cls, corners: Array) -> Footprint:
        """Return the footprint with these (n, 2) corners, counter-clockwise, around base_link [m]."""
        edges = np.roll(corners, -1, axis=0) - corners
        length = np.linalg.norm(edges, axis=1)
        inside = (corners[:, 0] * edges[:, 1] - corners[:, 1] * edges[:, 0]) / np.maximum(length, 1e-9)
        border = [
            corner + np.linspace(0.0, 1.0, max(1, math.ceil(n / SAMPLE)), endpoint=False)[:, None] * edge
            for corner, edge, n in zip(corners, edges, length, strict=True)
        ]
        reach = float(np.linalg.norm(corners, axis=1).max())
        return cls(corners, np.concatenate(border), max(0.0, float(inside.min())), reach)

    def at(self, pose: PlanarPose) -> Array:
        """Return its `samples` with the robot at a pose, (m, 2) in the frame of the pose [m]."""
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        return self.samples @ np.array([[c, s], [-s, c]]) + (pose.x, pose.y)


HOME = Footprint.of(np.array([[-0.12, -0.40], [0.40, -0.52], [0.53, -0.47], [0.53, 0.47], [0.40, 0.52], [-0.12, 0.40]]))
"""The robot with its arms at home, 2 cm wider all around: where nobody says how it holds them."""
