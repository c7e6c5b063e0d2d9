"""Where another camera shows a box that is known: by its shape alone, however little of it is in view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.perception.open_box import EDGE_ROOM, OpenBox
from golem.types import Array

SEARCHED = 0.12
"""How far beside its place a box is looked for [m] [own: head and palm camera differ by 5 cm, RMS]."""
RAISED: Array = np.arange(-0.04, 0.045, 0.01)
"""How much higher it may be [m]."""
SQUARE = 0.005
"""Side of the squares in which a view is compared with the box [m]."""
RIM = (-0.009, 0.001)
"""Where the rim is, from above, out of the box's sides [m]."""
THICK = 0.012
"""What is this near to the height of the rim is rim, and what is lower is none [m]."""
SHOWN = 0.3
"""Share of the rim that has to be in view."""
HALF = 0.5
"""Share of rim, and of inside, from which on it does not matter how much is in view."""
FAR = 0.5
"""By how much a box that is `SEARCHED` away has to be more alike."""
ALIKE = 0.8
"""How alike they have to be: 2 is a rim as high everywhere as it should be, around what is lower everywhere."""


def find_box(box: OpenBox, points: Array, around: Sequence[Array]) -> OpenBox | None:
    """Return `box` where a view shows it, with its shape and heading; None where nothing is like it.

    Of all shifts and heights on a grid that one counts at which most of the rim is as high as it should be, and most of
    the inside lower (`cv2.matchTemplate`). What is not in view does not count: before a palm camera the fingers cut a
    box in two, and a detector finds one half.

    Args:
        box: as another camera saw it, in odom.
        points: (n, 3) of the view, in odom [m].
        around: (2,) each, places around which its middle is looked for, in odom [m].
    """
    alike, found = max((_find(replace(box, center=at), points) for at in around), key=lambda one: one[0])
    return found if alike > ALIKE else None


def _find(box: OpenBox, points: Array) -> tuple[float, OpenBox]:
    """Return where a view shows `box`, around its middle, and how alike that is."""
    half = 0.5 * box.size
    cells, search = np.ceil(half / SQUARE).astype(int) + 1, round(SEARCHED / SQUARE)
    heights = _heights((points[:, :2] - box.center) @ box.axes, points[:, 2] - box.rim, cells + search)
    grid = np.stack(np.meshgrid(*(np.arange(-n, n + 1) * SQUARE for n in cells), indexing="ij"), axis=-1)
    beyond = (np.abs(grid) - half).max(axis=2)
    parts = [part / part.sum() for part in ((beyond > RIM[0]) & (beyond < RIM[1]), beyond < -EDGE_ROOM)]
    seen = np.isfinite(heights)
    shown = [_laid_over(seen, part) for part in parts]
    away = np.hypot(*np.meshgrid(*(np.arange(-search, search + 1) * (SQUARE / SEARCHED),) * 2, indexing="ij"))
    best, found = -np.inf, box
    for raised in RAISED:
        level = np.where(np.abs(heights - raised) < THICK, 1.0, np.where(heights < raised, -1.0, 0.0))
        rim, inside = (_laid_over(level, part) / np.maximum(s, HALF) for part, s in zip(parts, shown, strict=True))
        alike = np.where(shown[0] < SHOWN, -np.inf, rim - inside - FAR * away)
        i, j = np.unravel_index(int(alike.argmax()), alike.shape)
        if alike[i, j] > best:
            best = float(alike[i, j])
            shift = box.axes @ ((i - search) * SQUARE, (j - search) * SQUARE)
            found = replace(box, center=box.center + shift, rim=box.rim + raised, level=box.level + raised)
    return best, found


def _heights(flat: Array, z: Array, reach: NDArray[np.intp]) -> Array:
    """Return the highest `z` (n,) at `flat` (n, 2) [m] in each square, `reach` (2,) of them to each side of zero."""
    index = np.round(flat / SQUARE).astype(int) + reach
    inside = ((index >= 0) & (index <= 2 * reach)).all(axis=1)
    heights = np.full(2 * reach + 1, -np.inf)
    np.maximum.at(heights, tuple(index[inside].T), z[inside])
    heights[np.isneginf(heights)] = np.nan
    return heights


def _laid_over(image: Array, part: Array) -> Array:
    """Return the sum of `image` under `part`, for each place of it."""
    return np.asarray(cv2.matchTemplate(image.astype(np.float32), part.astype(np.float32), cv2.TM_CCORR), np.float64)
