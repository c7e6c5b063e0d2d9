"""Times a path of joints: corners rounded, speed as high as the limits allow, at rest at both ends.

Each corner becomes a parabola that leaves it at most a given distance away (as in Kunz and Stilman, 2012, with a
parabola in place of the arc). On a fine grid the speed is then bounded by the limits of velocity, of hand speed and of
the curvature's share of the acceleration, and swept forward and backward with the other share.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from golem.capabilities.planning import plan_kernel
from golem.types import Array

GRID = 0.02
"""Distance of the points of a timed path [rad in the joint that moves most]."""
CURVED = 0.5
"""Share of the acceleration that curves may use; the rest speeds up and brakes."""
SLACK = 0.97
"""Share of the speed limits that is planned with: between the points, the cubic is a little faster."""


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """How fast the joints and the hands may move.

    Attributes:
        speed: (n,) of each joint [rad/s].
        accel: (n,) of each joint [rad/s^2].
        hand_speed: of every hand [m/s].
    """

    speed: Array
    accel: Array
    hand_speed: float


def round_corners(corners: Array, cut: float, free: Callable[[Array], bool]) -> Array:
    """Return (m, n) points of a path whose corners are parabolas, no two farther apart than `GRID`.

    Args:
        corners: (k, n) of the path, k >= 2, neighbours apart.
        cut: how far before and after a corner the curve may begin and end [rad, Euclidean].
        free: says whether points (j, n) of a curve may be gone to; where not, a curve is made smaller, and at last
            none is.
    """
    legs = np.diff(corners, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    ways = legs / lengths[:, None]
    points: list[Array] = [corners[0]]
    for i in range(1, len(corners) - 1):
        most = min(cut, 0.5 * lengths[i - 1], 0.5 * lengths[i])
        for share in (1.0, 0.4, 0.15):
            a = corners[i] - share * most * ways[i - 1]
            b = corners[i] + share * most * ways[i]
            count = max(4, int(np.ceil(np.abs(b - a).max() / GRID)) + 2)
            u = np.linspace(0.0, 1.0, count + 1)[:, None]
            curve = (1 - u) ** 2 * a + 2 * u * (1 - u) * corners[i] + u**2 * b
            if free(curve):
                points += list(curve)
                break
        else:
            points.append(corners[i])
    points.append(corners[-1])
    out: list[Array] = [points[0]]
    for point in points[1:]:
        gap = float(np.abs(point - out[-1]).max())
        if gap < 1e-9:
            continue
        parts = int(np.ceil(gap / GRID))
        start = out[-1]
        out += [start + (point - start) * (k / parts) for k in range(1, parts + 1)]
    if len(out) == 2:
        # Two points at rest would need an infinite time between them.
        out.insert(1, 0.5 * (out[0] + out[1]))
    return np.array(out)


def time_path(points: Array, limits: MotionLimits, hands: Array) -> tuple[Array, Array]:
    """Return times (m,) [s] and velocities (m, n) [rad/s] of the points (m, n) of a path, m >= 3.

    Args:
        points: no two neighbours alike.
        limits: what is kept.
        hands: (m, k, 3) where the hands are at each point [m].
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    tangents = steps / lengths[:, None]
    at = np.concatenate(([tangents[0]], 0.5 * (tangents[1:] + tangents[:-1]), [tangents[-1]]))
    middle = 0.5 * (lengths[1:] + lengths[:-1])
    curvature = np.zeros_like(points)
    curvature[1:-1] = np.diff(tangents, axis=0) / middle[:, None]
    both = np.maximum(
        np.abs(tangents[np.r_[0, : len(tangents)]]), np.abs(tangents[np.r_[: len(tangents), -1]])
    )
    with np.errstate(divide="ignore"):
        cap = (SLACK * limits.speed / both).min(axis=1)
        cap = np.minimum(cap, np.sqrt((CURVED * limits.accel / np.abs(curvature)).min(axis=1)))
        moved = np.linalg.norm(np.diff(hands, axis=0), axis=2).max(axis=1) / lengths
        fastest = SLACK * limits.hand_speed / moved
    cap = np.minimum(cap, np.minimum(np.r_[fastest, np.inf], np.r_[np.inf, fastest]))
    v = plan_kernel.speeds_along(cap, lengths, tangents, (1.0 - CURVED) * limits.accel)
    times = np.concatenate(([0.0], np.cumsum(2.0 * lengths / (v[1:] + v[:-1]))))
    return times, at * v[:, None]
