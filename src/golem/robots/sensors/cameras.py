"""The three cameras of the H1-2: pinhole numbers, viewing rays, and the two conventions of a camera's axes."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from golem.types import Array, CameraInfo

HEAD = CameraInfo("head", 640, 480, fx=615.0, fy=615.0, cx=319.5, cy=239.5, near=0.28, far=3.0, rate=15.0)
"""RealSense D435i, depth aligned to colour. 615 px: the usual factory value of the colour imager at 640 x 480."""
LEFT_HAND = CameraInfo("left_hand", 480, 270, fx=243.5, fy=243.5, cx=239.5, cy=134.5, near=0.07, far=0.50, rate=15.0)
"""RealSense D405 in the palm: vertical field of view 58 deg (the lab's model of it), depth from 7 to 50 cm (paper)."""
RIGHT_HAND = CameraInfo("right_hand", 480, 270, fx=243.5, fy=243.5, cx=239.5, cy=134.5, near=0.07, far=0.50, rate=15.0)

CAMERAS: dict[str, CameraInfo] = {info.name: info for info in (HEAD, LEFT_HAND, RIGHT_HAND)}
"""Every camera by its name, which is also the name of the camera in the MuJoCo model."""

T_MUJOCO_OPTICAL: Array = np.diag([1.0, -1.0, -1.0, 1.0])
"""(4, 4) optical frame (z forward, y down) in a MuJoCo camera frame (looks along -z, y up); its own inverse."""
T_MUJOCO_OPTICAL.setflags(write=False)


@lru_cache(maxsize=16)
def rays(info: CameraInfo) -> NDArray[np.float32]:
    """Return each pixel's ray in the optical frame, (height, width, 3), read-only: times depth it is the point."""
    u, v = np.meshgrid(np.arange(info.width), np.arange(info.height))
    out = np.empty((info.height, info.width, 3), np.float32)
    out[..., 0] = (u - info.cx) / info.fx
    out[..., 1] = (v - info.cy) / info.fy
    out[..., 2] = 1.0
    out.setflags(write=False)
    return out


def project(info: CameraInfo, points: Array) -> Array:
    """Return the pixels of points, (..., 2) x, y [px], not clipped to the image.

    `points`: (..., 3) in the optical frame [m], z > 0.
    """
    p = np.asarray(points, np.float64)
    return p[..., :2] / p[..., 2:] * (info.fx, info.fy) + (info.cx, info.cy)
