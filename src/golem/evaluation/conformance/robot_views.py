"""What a robot's cameras and LiDAR should see of the robot and the floor, by its model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.robots.model.kinematics import Kinematics
from golem.robots.sensors.calibration import OPTICAL_FRAMES
from golem.robots.sensors.cameras import project
from golem.types import Array, CameraInfo, LowState

ALONG = (0.0, 0.05, 0.1, 0.15, 0.2, 0.85, 0.9, 0.95)
"""Where on the way from the wrist to the grasp frame the arm is solid; between them one can look through the hand."""
WINDOW = 4
"""Half the window around a pixel whose median depth counts [px]."""
LAYER = 0.04
"""Thickness of the layer in which the floor is looked for [m]."""
BELOW = 0.4
"""How far under the pelvis the floor is at least [m]."""


def rotated(quat: Array, inverse: bool = False) -> Array:
    """Return the world's up, (3,), turned by a quaternion wxyz; with `inverse` as the body that has it sees it."""
    w, x, y, z = quat / np.linalg.norm(quat)
    s = -1.0 if inverse else 1.0
    return np.array([2.0 * (x * z + s * w * y), 2.0 * (y * z - s * w * x), 1.0 - 2.0 * (x * x + y * y)])


def up_in_base(state: LowState, kinematics: Kinematics) -> Array:
    """Return up, (3,) in base_link, by the torso's IMU; `kinematics` is at the joints of `state`."""
    return kinematics.pose("imu_link")[:3, :3] @ rotated(state.imu.quat, inverse=True)


def gap_to_own_arm(q: Array, depth: NDArray[np.float32], info: CameraInfo, calibration: Array) -> float:
    """Return how much nearer than the axis of the right hand a camera measures it [m], a median over points.

    Args:
        q: (27,) joints [rad].
        depth: (height, width) of the head camera [m].
        info: that camera.
        calibration: (4, 4), see `golem.robots.base.Robot`.

    Returns:
        NaN where less than half of the points are in the image and were measured.
    """
    kinematics = Kinematics()
    kinematics.update(q)
    T_optical_base = np.linalg.inv(kinematics.pose(OPTICAL_FRAMES["head"]) @ calibration)
    ends = [kinematics.pose(f"right_{name}")[:3, 3] for name in ("wrist_yaw_link", "gripper")]
    nearer: list[float] = []
    for share in ALONG:
        base = ends[0] + share * (ends[1] - ends[0])
        point = T_optical_base[:3, :3] @ base + T_optical_base[:3, 3]
        u, v = np.round(project(info, point)).astype(int)
        if not (WINDOW <= u < info.width - WINDOW and WINDOW <= v < info.height - WINDOW):
            continue
        window = depth[v - WINDOW : v + WINDOW + 1, u - WINDOW : u + WINDOW + 1]
        measured = window[window > 0.0]
        if measured.size > 0.3 * window.size:
            nearer.append(float(point[2] - np.median(measured)))
    return float(np.median(nearer)) if 2 * len(nearer) >= len(ALONG) else float("nan")


def floor_normal(points: Array, up: Array) -> tuple[Array, float, float]:
    """Return normal, roughness [m] and depth [m] of the floor in a cloud.

    Args:
        points: (n, 3) in base_link [m].
        up: (3,) in base_link.

    Returns:
        (3,) upward normal; standard deviation of the points from the plane; how far base_link is above it.
    """
    height = points @ up
    low = height[height < -BELOW]
    if low.size < 100:
        return np.full(3, np.nan), float("nan"), float("nan")
    counts, edges = np.histogram(low, bins=np.arange(low.min(), low.max() + LAYER, 0.5 * LAYER))
    middle = edges[int(np.argmax(counts))] + 0.25 * LAYER
    near = points[np.abs(height - middle) < LAYER]
    centre = near.mean(axis=0)
    _, size, axes = np.linalg.svd(near - centre, full_matrices=False)
    normal = axes[2] if axes[2] @ up > 0.0 else -axes[2]
    return normal, float(size[2] / np.sqrt(len(near))), float(-(centre @ normal))
