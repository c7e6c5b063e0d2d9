"""Tries twists: where each leads within the next moments, and whether the footprint stays clear of what is there then.

The dynamic window approach (Fox, Burgard and Thrun, 1997) with three components of the twist. Obstacles stand; people
are where they will be at each moment, as with Seder and Petrovic (2007).
"""

from __future__ import annotations

import math

import numpy as np

from golem.kernels import njit
from golem.types import Array

HIT = 1e9
"""Score of a twist that leads into an obstacle."""
DOUBT = 0.1
"""By how much more space somebody who walks needs per second that is looked ahead [m/s] [own]."""


@njit(cache=True, nogil=True, error_model="numpy")
def score(
    twists: Array,
    pose: Array,
    samples: Array,
    clearance: Array,
    frame: Array,
    people: Array,
    aim: Array,
    weights: Array,
    horizon: Array,
    scores: Array,
    hits: Array,
    spare: Array,
) -> None:
    """Write the (n,) score of each twist, the lower the better, when it hits something, and how near people come.

    Args:
        twists: (n, 3) vx, vy, wz.
        pose: (3,) of base_link in the frame of the map.
        samples: (m, 2) places on the footprint's edge in base_link.
        clearance: (rows, columns) distance from the nearest obstacle [m].
        frame: (5,) x, y, cosine and sine of the map's corner, and its resolution.
        people: (k, 5) those who walk: place [m] and velocity [m/s] in the frame of the map, and radius [m].
        aim: (3,) place to come near, and heading to have there, in the frame of the map.
        weights: (4,) per metre from the aim, per radian off its heading, of nearness, and the clearance that is asked
            for [m].
        horizon: (3,) time for which a twist is tried, step, and time up to which the robot that then stands shall have
            nobody walk into it [s].
        scores: (n,) written.
        hits: (n,) written: the time of the first contact [s], infinite without one.
        spare: (n,) written: the least distance of base_link from people [m], far below zero where the twist hits an
            obstacle.
    """
    rows, columns = clearance.shape
    steps, last = int(round(horizon[0] / horizon[1])), int(round(horizon[2] / horizon[1]))
    for i in range(len(twists)):
        vx, vy, wz = twists[i, 0], twists[i, 1], twists[i, 2]
        x, y, yaw = pose[0], pose[1], pose[2]
        nearest, hits[i], spare[i] = 10.0, np.inf, 10.0
        first = beside = 10.0
        for step in range(max(steps, last if len(people) else 0) + 1):
            c, s, t = math.cos(yaw), math.sin(yaw), step * horizon[1]
            least = between = 10.0
            for j in range(len(samples)):
                at_x = x + c * samples[j, 0] - s * samples[j, 1]
                at_y = y + s * samples[j, 0] + c * samples[j, 1]
                for k in range(len(people)):
                    px, py = people[k, 0] + t * people[k, 2], people[k, 1] + t * people[k, 3]
                    between = min(between, math.hypot(at_x - px, at_y - py) - people[k, 4] - DOUBT * t)
                u, v = at_x - frame[0], at_y - frame[1]
                column = int(math.floor((frame[2] * u + frame[3] * v) / frame[4]))
                row = int(math.floor((frame[2] * v - frame[3] * u) / frame[4]))
                if 0 <= row < rows and 0 <= column < columns and clearance[row, column] < least:
                    least = clearance[row, column]
            if step == 0:
                first, beside = least, between
            # A robot that is too near already may go where it comes no nearer.
            elif least < weights[3] and least < first - 0.01:
                hits[i], spare[i] = min(hits[i], t), -10.0
                break
            elif between < weights[3] and between < beside - 0.01:
                hits[i] = min(hits[i], t)
            nearest = min(nearest, min(least, between))
            moves = horizon[1] if step <= steps else 0.0
            dx, dy = moves * (c * vx - s * vy), moves * (s * vx + c * vy)
            for k in range(len(people)):
                # Closest approach until the next step, seen from base_link.
                u, v = people[k, 0] + t * people[k, 2] - x, people[k, 1] + t * people[k, 3] - y
                du, dv = horizon[1] * people[k, 2] - dx, horizon[1] * people[k, 3] - dy
                square = du * du + dv * dv
                share = 0.0 if square == 0.0 else min(max(-(u * du + v * dv) / square, 0.0), 1.0)
                spare[i] = min(spare[i], math.hypot(u + share * du, v + share * dv) - people[k, 4])
            x, y, yaw = x + dx, y + dy, yaw + moves * wz
        if hits[i] < np.inf:
            scores[i] = HIT - hits[i]
            continue
        off = math.hypot(aim[0] - x, aim[1] - y)
        turn = abs(math.atan2(math.sin(aim[2] - yaw), math.cos(aim[2] - yaw)))
        scores[i] = weights[0] * off + weights[1] * turn + weights[2] / (0.1 + max(nearest, 0.0))
