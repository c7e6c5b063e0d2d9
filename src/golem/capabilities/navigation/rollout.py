"""Tries twists: where each leads within the next moments, and whether the footprint stays clear of obstacles there.

The dynamic window approach (Fox, Burgard and Thrun, 1997) with three components of the twist.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from golem.types import Array

HIT = 1e9
"""Score of a twist that leads into an obstacle."""


@njit(cache=True, nogil=True)
def score(
    twists: Array,
    pose: Array,
    samples: Array,
    clearance: Array,
    frame: Array,
    aim: Array,
    weights: Array,
    horizon: Array,
    scores: Array,
    hits: Array,
) -> None:
    """Write the (n,) score of each twist, the lower the better, and when it hits an obstacle.

    Args:
        twists: (n, 3) vx, vy, wz.
        pose: (3,) of base_link in the frame of the map.
        samples: (m, 2) places on the footprint's edge in base_link.
        clearance: (rows, columns) distance from the nearest obstacle [m].
        frame: (5,) x, y, cosine and sine of the map's corner, and its resolution.
        aim: (3,) place to come near, and heading to have there, in the frame of the map.
        weights: (4,) per metre from the aim, per radian off its heading, of nearness, and the clearance that is asked
            for [m].
        horizon: (2,) length and step [s].
        scores: (n,) written.
        hits: (n,) written: the time of the first contact [s], infinite without one.
    """
    rows, columns = clearance.shape
    steps = int(round(horizon[0] / horizon[1]))
    for i in range(len(twists)):
        vx, vy, wz = twists[i]
        x, y, yaw = pose[0], pose[1], pose[2]
        nearest, hits[i] = 10.0, np.inf
        first = 10.0
        for step in range(steps + 1):
            c, s = math.cos(yaw), math.sin(yaw)
            least = 10.0
            for j in range(len(samples)):
                u = x + c * samples[j, 0] - s * samples[j, 1] - frame[0]
                v = y + s * samples[j, 0] + c * samples[j, 1] - frame[1]
                column = int(math.floor((frame[2] * u + frame[3] * v) / frame[4]))
                row = int(math.floor((frame[2] * v - frame[3] * u) / frame[4]))
                if 0 <= row < rows and 0 <= column < columns and clearance[row, column] < least:
                    least = clearance[row, column]
            if step == 0:
                first = least
            # A robot that is too near already may go where it comes no nearer.
            elif least < weights[3] and least < first - 0.01:
                hits[i] = step * horizon[1]
                break
            nearest = min(nearest, least)
            x += horizon[1] * (c * vx - s * vy)
            y += horizon[1] * (s * vx + c * vy)
            yaw += horizon[1] * wz
        if hits[i] < np.inf:
            scores[i] = HIT - hits[i]
            continue
        off = math.hypot(aim[0] - x, aim[1] - y)
        turn = abs(math.atan2(math.sin(aim[2] - yaw), math.cos(aim[2] - yaw)))
        scores[i] = weights[0] * off + weights[1] * turn + weights[2] / (0.1 + max(nearest, 0.0))
