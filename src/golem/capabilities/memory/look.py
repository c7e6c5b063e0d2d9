"""What a look says of places where something is expected: seen through, seen without it, hidden or not in view."""

from __future__ import annotations

from enum import Enum

import numpy as np

from golem.robots.sensors.cameras import project
from golem.types import Array, RgbdImage

BEHIND = 0.05
"""How far behind an object's place, and its standard deviation, the surface of a look through it has to be [m].

The place is the median of what was seen of the object: of itself no more than half is behind that.
"""
LEVEL = 0.3
"""Sine of the angle off the vertical from which on a view has an upper half."""
SHARE = 0.9
"""Share of the window that has to be seen through."""
MARGIN = 1.5
"""The window is wider than the object by this many standard deviations of its place, to each side."""
SMALLEST = 3
"""Least half width of a window [px]; a smaller object's absence is not judged."""
VALID = 0.5
"""Least share of a window with depth."""


class Look(Enum):
    """What a look says of one expected object."""

    OUT_OF_VIEW = "out of view"
    HIDDEN = "hidden"
    EMPTY = "empty"
    THROUGH = "through"


def look_at(frame: RgbdImage, positions: Array, sizes: Array, sigmas: Array) -> list[Look]:
    """Return what the frame says of objects that it did not detect.

    Args:
        positions: (n, 3) where they are expected, in the frame of `frame.T_odom_optical` [m].
        sizes: (n,) their radii [m].
        sigmas: (n,) standard deviations of their positions, relative to the frame [m].
    """
    info = frame.info
    T = np.linalg.inv(frame.T_odom_optical)
    optical = np.asarray(positions, float) @ T[:3, :3].T + T[:3, 3]
    out = [Look.OUT_OF_VIEW] * len(optical)
    depth, up = optical[:, 2], T[:2, 2]
    near = (depth > info.near) & (depth < info.far)
    for k in np.flatnonzero(near):
        x, y = project(info, optical[k])
        half = info.fx * (sizes[k] + MARGIN * sigmas[k]) / depth[k]
        x0, x1, y0, y1 = round(x - half), round(x + half), round(y - half), round(y + half)
        if half < SMALLEST or x0 < 0 or y0 < 0 or x1 >= info.width or y1 >= info.height:
            continue
        window = frame.depth[y0 : y1 + 1, x0 : x1 + 1]
        if np.hypot(*up) > LEVEL:  # below its middle is what it stands on
            right, down = np.arange(x0, x1 + 1) - x, np.arange(y0, y1 + 1) - y
            window = window[up[0] * right[None, :] + up[1] * down[:, None] >= 0.0]
        valid = window[window > 0.0]
        if len(valid) < VALID * window.size:
            continue
        behind = np.mean(valid > depth[k] + sigmas[k] + BEHIND)
        before = np.mean(valid < depth[k] - sizes[k] - MARGIN * sigmas[k] - BEHIND)
        if behind >= SHARE:
            out[k] = Look.THROUGH
        else:
            out[k] = Look.HIDDEN if before > 1.0 - SHARE else Look.EMPTY
    return out
