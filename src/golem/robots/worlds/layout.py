"""Where everything stands around the battery pack, and the 68 places of the cover's fasteners."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from golem.robots.model.spatial import rotation_rpy, transform
from golem.types import Array, PlanarPose

RIM_INSET = 0.022
"""Distance of the fastener line from the cover's edge [m]."""
FASTENERS_X = 13
FASTENERS_Y = 21
"""Intervals along a short and a long side; 2 (13 + 21) = 68 fasteners, the count of RAPID (arXiv 2603.18520)."""
HOLE_CELL = 0.007
"""Half side of the square that a bore or an empty hole takes out of the rim's collision and visual strips [m]."""

GANTRY = "gantry_tool"
"""Mocap body of the gantry's tool; its origin is the tool's tip."""

Kind = Literal["screw", "nut", "bolt"]
KINDS: tuple[Kind, ...] = ("screw", "nut", "bolt")


class TrayPlace(NamedTuple):
    """A tray: its body's `name`, the `kind` of fasteners it is for, and its underside's middle and heading [m, rad]."""

    name: str
    kind: Kind
    x: float
    y: float
    z: float
    yaw: float

    def pose(self) -> Array:
        """Return the (4, 4) pose in the world."""
        return transform((self.x, self.y, self.z), rotation_rpy(0.0, 0.0, self.yaw))


@dataclass(frozen=True, slots=True)
class PackLayout:
    """Pose and size of the pack and the tray; x forward from the robot that stands at the origin, z up.

    Attributes:
        near_edge: x of the cover's edge next to the robot [m].
        center_y: y of the cover's middle [m]; half a fastener pitch to the left of the robot, so that one screw
            stands before its middle and the tray is in the head camera's view.
        top_z: height of the cover's rim above the floor [m].
        size_x, size_y: outer size of the cover [m]; the long side runs along y (1.2 x 2.0 m in the paper).
        thickness: height of cover and tray of the pack together [m].
        window_x: near and far edge of the opened inspection section, measured from `near_edge` [m].
        window_y: its right and left edge [m].
        window_depth: how far the modules lie below the rim [m].
        empty_holes: fastener indices whose screw is already gone.
        yaw: heading of the pack [rad], turned about the middle of its near edge.
        tray_xy: centre of the parts tray [m].
        tray_z: height of the tray's underside [m].
        tray_yaw: heading of the tray [rad].
        tray_size: outer size of the tray in x, y and z [m].
    """

    near_edge: float = 0.41
    center_y: float = 0.0466
    top_z: float = 1.055
    size_x: float = 1.2
    size_y: float = 2.0
    thickness: float = 0.15
    window_x: tuple[float, float] = (0.13, 0.62)
    window_y: tuple[float, float] = (-0.34, 0.34)
    window_depth: float = 0.035
    empty_holes: tuple[int, ...] = (5, 16, 24, 29, 62)
    tray_xy: tuple[float, float] = (0.48, -0.28)
    tray_z: float = 1.068
    yaw: float = 0.0
    tray_yaw: float = 0.0
    tray_size: tuple[float, float, float] = (0.18, 0.24, 0.045)

    def raised(self, by: float) -> PackLayout:
        """Return the layout with pack and tray `by` higher [m]."""
        return replace(self, top_z=self.top_z + by, tray_z=self.tray_z + by)

    def seen_with(self, stance: PlanarPose) -> PackLayout:
        """Return the layout of a robot that stands elsewhere: `stance` is where it should stand, in its own frame."""
        if stance == PlanarPose(0.0, 0.0, 0.0):
            return self  # to the last bit where it was
        pack = stance @ PlanarPose(self.near_edge, self.center_y, self.yaw)
        tray = stance @ PlanarPose(*self.tray_xy, self.tray_yaw)
        return replace(
            self, near_edge=pack.x, center_y=pack.y, yaw=pack.yaw, tray_xy=(tray.x, tray.y), tray_yaw=tray.yaw
        )

    def pose(self) -> Array:
        """Return the (4, 4) pose of the pack frame (origin: middle of the near edge, on the rim) in the world."""
        return transform((self.near_edge, self.center_y, self.top_z), rotation_rpy(0.0, 0.0, self.yaw))

    def tray_pose(self) -> Array:
        """Return the (4, 4) pose of the tray in the world: the middle of its underside."""
        return self.trays()[0].pose()

    def trays(self) -> tuple[TrayPlace, ...]:
        """Return where all trays stand, first the one of `tray_pose`."""
        return (TrayPlace("tray", "screw", *self.tray_xy, self.tray_z, self.tray_yaw),)

    def kind(self, slot: int) -> Kind:
        """Return what is in a place."""
        return "screw"

    def fasteners(self) -> Array:
        """Return the (68, 3) places of the fasteners in the pack frame, on the surface they are screwed to.

        Index 0 is the near right corner (y < 0); the near edge comes first, from right to left, then the left
        side, the far edge from left to right, and the right side back to the start.
        """
        near, far = RIM_INSET, self.size_x - RIM_INSET
        right, left = -self.size_y / 2 + RIM_INSET, self.size_y / 2 - RIM_INSET
        y_up = np.linspace(right, left, FASTENERS_Y + 1)
        x_out = np.linspace(near, far, FASTENERS_X + 1)
        sides = [
            np.column_stack([np.full(FASTENERS_Y, near), y_up[:-1]]),
            np.column_stack([x_out[:-1], np.full(FASTENERS_X, left)]),
            np.column_stack([np.full(FASTENERS_Y, far), y_up[:0:-1]]),
            np.column_stack([x_out[:0:-1], np.full(FASTENERS_X, right)]),
        ]
        return np.column_stack([np.concatenate(sides), np.zeros(2 * (FASTENERS_X + FASTENERS_Y))])

    def holes(self) -> Array:
        """Return the (n, 3) holes that never held a fastener, in the pack frame."""
        return np.zeros((0, 3))

    def around(self, reach_y: float) -> list[int]:
        """Return the places where fasteners may be loose or gone: here those of `reachable`."""
        return self.reachable(reach_y)

    def reachable(self, reach_y: float = 0.35) -> list[int]:
        """Return the indices of the near-edge fasteners with |y| <= `reach_y` [m], from right to left."""
        spots = self.fasteners()
        return [i for i in range(FASTENERS_Y + 1) if i < len(spots) and abs(spots[i, 1]) <= reach_y]


def yaw_quat(yaw: float) -> list[float]:
    """Return the quaternion (wxyz) of a turn by `yaw` [rad] about the vertical."""
    return [float(np.cos(yaw / 2)), 0.0, 0.0, float(np.sin(yaw / 2))]
