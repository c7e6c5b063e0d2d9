"""Where the near edge of a table-like thing is, from points on its rim: a line on the floor, and its two ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.types import Array, PlanarPose

SLICE = 0.05
"""Width of the slices across the view of which each has one point of the rim [m]."""
INLIER = 0.02
"""Distance from the line within which a slice's point belongs to it [m]."""
FEWEST = 8
"""Slices that make an edge: 0.4 m."""
IN_FRONT = 2.0
"""How many slices on a line one before it outweighs [own: one on one took a row of things for the edge]."""
TRIES = 60
LEVELS = (0.6, 1.3)
"""Heights between which the top of a table is looked for [m]."""
LEVEL = 0.02
"""Height of the slices of that search [m]."""
ENOUGH = 200
"""Points that make a search worth while."""


@dataclass(frozen=True, slots=True)
class NearEdge:
    """A straight near edge.

    Attributes:
        pose: middle of the edge, heading across it, away from the robot; in the frame of the points.
        length: between its ends [m].
        spread: RMS distance of the slices' points from the line [m].
        height: of the top above the floor [m]; NaN where nobody said.
    """

    pose: PlanarPose
    length: float
    spread: float
    slices: int
    height: float = math.nan


def table_height(local: Array, heights: Array) -> float | None:
    """Return the height above the floor of the largest level surface ahead [m]; None where there is none.

    The points are `local` (n, 2), as seen from the robot, which looks along x [m], at `heights` (n,) above the floor
    [m].
    """
    low, high = LEVELS
    ahead = (local[:, 0] > 0.1) & (local[:, 0] < 2.5) & (np.abs(local[:, 1]) < 1.0)
    ahead &= (heights > low) & (heights < high)
    if ahead.sum() < ENOUGH:
        return None
    count, edges = np.histogram(heights[ahead], bins=round((high - low) / LEVEL), range=LEVELS)
    # Three levels together: the noise of the ranges spreads a surface over as many.
    best = int(np.convolve(count, np.ones(3), mode="same").argmax())
    near = slice(max(best - 1, 0), best + 2)
    return float(np.average((0.5 * (edges[1:] + edges[:-1]))[near], weights=count[near]))


def near_edge(points: Array, view: PlanarPose, reach: float = 2.5, half_width: float = 1.4) -> NearEdge | str:
    """Return the near edge of what stands before the robot, or one sentence why there is none.

    Args:
        points: (n, 2) of the rim, at heights where the thing is and its stand is not [m].
        view: where the robot is and looks, in the frame of the points.
        reach: distance ahead up to which points count [m].
        half_width: how far to both sides they do [m].
    """
    c, s = math.cos(view.yaw), math.sin(view.yaw)
    local = (points - (view.x, view.y)) @ np.array([[c, -s], [s, c]])
    local = local[(local[:, 0] > 0.1) & (local[:, 0] < reach) & (np.abs(local[:, 1]) < half_width)]
    rim = _rim(local)
    if len(rim) < FEWEST:
        return f"Nothing with an edge is within {reach:g} m ahead: {len(rim)} of {FEWEST} slices have points."
    line = _line(rim)
    if line is None:
        return "The points ahead are on no straight edge."
    slope, offset, good = line
    kept = rim[good]
    angle = math.atan(slope)
    along = kept @ np.array([math.sin(angle), math.cos(angle)])
    across = (kept[:, 0] - slope * kept[:, 1] - offset) * math.cos(angle)
    middle = 0.5 * (along.min() + along.max())
    # The foot of the perpendicular from the robot, and from there along the edge.
    foot = offset * math.cos(angle)
    x = foot * math.cos(angle) + middle * math.sin(angle)
    y = -foot * math.sin(angle) + middle * math.cos(angle)
    pose = view @ PlanarPose(x, y, -angle)
    return NearEdge(pose, float(np.ptp(along)) + SLICE, float(np.sqrt(np.mean(across**2))), int(good.sum()))


def _rim(local: Array) -> Array:
    """Return one (x, y) per slice across the view: its nearest points, and its middle."""
    slices = np.floor(local[:, 1] / SLICE).astype(int)
    found: list[tuple[float, float]] = []
    for k in np.unique(slices):
        part = local[slices == k]
        if len(part) >= 5:
            found.append((float(np.quantile(part[:, 0], 0.1)), float(np.median(part[:, 1]))))
    return np.array(found).reshape(-1, 2)


def _line(rim: Array) -> tuple[float, float, NDArray[np.bool_]] | None:
    """Return slope and offset of x = slope y + offset, and which points are on it; None where too few are."""
    rng = np.random.default_rng(0)
    best, most = np.zeros(len(rim), np.bool_), -math.inf
    for _ in range(TRIES):
        i, j = rng.choice(len(rim), 2, replace=False)
        if abs(rim[j, 1] - rim[i, 1]) < 2.0 * SLICE:
            continue
        slope = (rim[j, 0] - rim[i, 0]) / (rim[j, 1] - rim[i, 1])
        behind = rim[:, 0] - rim[i, 0] - slope * (rim[:, 1] - rim[i, 1])
        good = np.abs(behind) < INLIER
        # Nothing of a table is before its near edge: what is says that this is another line, through what stands on it.
        score = float(good.sum()) - IN_FRONT * float((behind < -INLIER).sum())
        if abs(slope) < 1.0 and good.sum() >= FEWEST and score > most:
            best, most = good, score
    if not best.any():
        return None
    slope, offset = np.polyfit(rim[best, 1], rim[best, 0], 1)
    return float(slope), float(offset), best
