"""What the scorer's network sees of a grasp: the thing's cloud from the hand, in four pictures, and a few numbers.

Pictures of the cloud along the axes of the hand, after ten Pas et al. (GPD, IJRR 2017); the first is of the slice that
the pads close on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.grasping.base import Grasp
from golem.robots.model.magpie_model import MAX_GAP
from golem.types import Array

FINGER = (0.012, 0.022, 0.090)
"""Half width along x, thickness along y and length along z of a finger behind its tip [m]."""
PALM = ((-0.035, 0.035), (-0.065, 0.065), (-0.200, -0.095))
"""x, y and z bounds of housing and palm camera in the grasp frame [m]."""
TOUCHING = 2
"""Points in the hand's volume from which on it collides: stray ones come alone."""


def collides(T: Array, gaps: Array, points: Array) -> NDArray[np.bool_]:
    """Return (n,) whether the open hand at each pose holds points in its own volume.

    It is at `T` (n, 4, 4) with openings `gaps` (n,) [m]; `points` (m, 3) are in the same frame [m].
    """
    local = in_hands(T, points)
    x, y, z = np.abs(local[..., 0]), np.abs(local[..., 1]), local[..., 2]
    half = 0.5 * gaps[:, None]
    finger = (x < FINGER[0]) & (y > half) & (y < half + FINGER[1]) & (z > -FINGER[2]) & (z < 0.0)
    palm = (x < PALM[0][1]) & (y < PALM[1][1]) & (z > PALM[2][0]) & (z < PALM[2][1])
    return (finger | palm).sum(axis=1) >= TOUCHING


def in_hands(T: Array, points: Array) -> Array:
    """Return (n, m, 3) `points` (m, 3) in each of the frames `T` (n, 4, 4)."""
    R = T[:, :3, :3]
    return points @ R - np.einsum("ni,nij->nj", T[:, :3, 3], R)[:, None]


CELL = 0.008
"""Side of a picture's cell [m]."""
LOW: Array = np.array([-0.048, -0.064, -0.088])
"""(3,) corner of what is seen, in the grasp frame [m]."""
CELLS = (12, 16, 16)
"""How many cells there are along x, y and z."""
PADS = 0.012
"""Half the thickness of the slice that the pads close on [m]."""
PLANES = ((1, 2), (1, 2), (0, 2), (0, 1))
"""Axes of the four pictures; the first is of the slice between the pads alone."""
SHAPES = tuple((CELLS[a], CELLS[b]) for a, b in PLANES)
SEEN = sum(rows * columns for rows, columns in SHAPES)
"""How many cells they have in all."""
FACTS = 12
"""How many numbers there are."""
FLIPPED_FACTS = ((3, 9), (2, 8))
"""Which of them change their sign where the hand's x is mirrored, and where its y is."""


def hand_view(grasps: Sequence[Grasp], cloud: Array) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """Return the pictures and numbers of each grasp.

    Args:
        grasps: n of them.
        cloud: (m, 3) points of the thing alone, in the frame of the grasps [m]; m is not 0.

    Returns:
        (n, `SEEN`) cells of the four pictures, one after the other, in which a point lies; (n, `FACTS`) numbers of the
        order of one.
    """
    T = np.stack([grasp.T_odom_gripper for grasp in grasps])
    local = in_hands(T, cloud).astype(np.float32)
    index = np.floor((local - LOW.astype(np.float32)) * np.float32(1.0 / CELL)).astype(np.int32)
    # One number per point, and what is outside goes to a column that is cut off.
    inside = [(index[..., k] >= 0) & (index[..., k] < CELLS[k]) for k in range(3)]
    slab = np.abs(local[..., 0]) < PADS
    rows = np.arange(len(T), dtype=np.int32)[:, None]
    pictures: list[NDArray[np.bool_]] = []
    for k, (a, b) in enumerate(PLANES):
        seen = inside[a] & inside[b] & slab if k == 0 else inside[a] & inside[b]
        size = CELLS[a] * CELLS[b]
        flat = np.where(seen, index[..., a] * CELLS[b] + index[..., b], size) + rows * (size + 1)
        picture = np.zeros((len(T), size + 1), bool)
        picture.ravel()[flat.ravel()] = True
        pictures.append(picture[:, :size])
    return np.concatenate(pictures, axis=1), _facts(grasps, T, local, slab)


def mirrored(
    cells: NDArray[np.bool_], facts: NDArray[np.float32], axis: int
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """Return the same of hands and clouds that are mirrored along x (`axis` 0) or y (1): they hold as well."""
    out: list[NDArray[np.bool_]] = []
    first = 0
    for shape, plane in zip(SHAPES, PLANES, strict=True):
        picture = cells[:, first : first + shape[0] * shape[1]].reshape(-1, *shape)
        first += shape[0] * shape[1]
        picture = np.flip(picture, 1 + plane.index(axis)) if axis in plane else picture
        out.append(picture.reshape(len(cells), -1))
    facts = facts.copy()
    facts[:, FLIPPED_FACTS[axis]] *= -1.0
    return np.concatenate(out, axis=1), facts


def _facts(
    grasps: Sequence[Grasp], T: Array, local: NDArray[np.float32], slab: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return opening, score, middle and spread of the cloud in the hand, how the hand comes, and what it holds."""
    gaps = np.array([grasp.gap for grasp in grasps])
    middle, spread = local.mean(axis=1) / 0.05, local.std(axis=1) / 0.05
    # What of the pads' slice is between the fingers, behind their tips.
    held = slab & (np.abs(local[..., 1]) < 0.5 * gaps[:, None]) & (local[..., 2] < 0.0)
    depth = np.where(held, -local[..., 2], 0.0).max(axis=1) / 0.05
    columns = [
        gaps / MAX_GAP, np.array([grasp.score for grasp in grasps]), middle[:, 1], middle[:, 0], middle[:, 2],
        held.mean(axis=1), depth, -T[:, 2, 2], T[:, 2, 1], T[:, 2, 0], spread[:, 1], spread[:, 2],
    ]  # fmt: skip
    return np.column_stack(columns).astype(np.float32)
