"""A map of planes: voxels of several sizes, each with the statistics of its points and the plane through them.

Planes grow point by point, as in probabilistic voxel maps (Yuan et al., RA-L 2022): there is no tree to rebuild and no
neighbour to search, and a plane of hundreds of points is known better than any of them. A point is compared with the
plane of the largest voxel around it that is flat.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from golem.kernels import njit
from golem.types import Array

SIZES = (1.0, 0.4)
"""Side of the voxels, the largest first [m]."""
FULL = 400.0
"""Points after which a voxel takes no more: what was seen first stays the reference."""
FLAT = 0.045
"""Largest standard deviation of a plane's points along its normal [m]: noise of the ranges, with a margin."""
LEAST = 8.0
"""Points a plane needs."""

_EMPTY = np.int64(-(2**62))
# Columns of a cell: count, sum of points from the voxel's middle (3), of products xx xy xz yy yz zz (6), normal (3),
# offset along it, variance across the plane, 1 where it is a plane, variance of the place when it was first seen.
_COUNT, _SUM, _PRODUCTS, _NORMAL, _OFFSET, _SPREAD, _PLANE, _BIRTH, _WIDTH = 0, 1, 4, 10, 13, 14, 15, 16, 17


class PlaneMap:
    """The voxels of every size, in hash tables that grow."""

    def __init__(self) -> None:
        self.keys: NDArray[np.int64] = np.full((len(SIZES), 2**13), _EMPTY)
        self.cells: Array = np.zeros((len(SIZES), 2**13, _WIDTH))
        self._used: NDArray[np.int64] = np.zeros(len(SIZES), dtype=np.int64)

    def __len__(self) -> int:
        return int(self._used.sum())

    def insert(self, points: Array, birth: float) -> None:
        """Add (n, 3) points in the map's frame [m]; `birth` is the variance of the place seen from, per axis [m^2]."""
        while self._used.max() + len(points) > 0.7 * self.keys.shape[1]:
            self._grow()
        _insert(points, birth, self.keys, self.cells, self._used, np.array(SIZES))

    def _grow(self) -> None:
        keys, cells = self.keys, self.cells
        self.keys = np.full((len(SIZES), 2 * keys.shape[1]), _EMPTY)
        self.cells = np.zeros((len(SIZES), 2 * keys.shape[1], _WIDTH))
        _move(keys, cells, self.keys, self.cells)


@njit(cache=True, nogil=True, error_model="numpy")
def _key(x: float, y: float, z: float, size: float) -> int:
    i, j, k = int(math.floor(x / size)), int(math.floor(y / size)), int(math.floor(z / size))
    return ((i + 1048576) << 42) | ((j + 1048576) << 21) | (k + 1048576)


@njit(cache=True, nogil=True, error_model="numpy")
def _slot(keys: NDArray[np.int64], key: int) -> int:
    """Return where `key` is, or the empty place where it belongs."""
    mask = len(keys) - 1
    h = key * 0x9E3779B97F4A7C1
    h = (h ^ (h >> 29)) & mask
    while keys[h] != key and keys[h] != _EMPTY:
        h = (h + 1) & mask
    return h


@njit(cache=True, nogil=True, error_model="numpy")
def _move(keys: NDArray[np.int64], cells: Array, to_keys: NDArray[np.int64], to_cells: Array) -> None:
    for level in range(keys.shape[0]):
        for i in range(keys.shape[1]):
            if keys[level, i] != _EMPTY:
                h = _slot(to_keys[level], keys[level, i])
                to_keys[level, h] = keys[level, i]
                for k in range(_WIDTH):
                    to_cells[level, h, k] = cells[level, i, k]


@njit(cache=True, nogil=True, error_model="numpy")
def _insert(
    points: Array, birth: float, keys: NDArray[np.int64], cells: Array, used: NDArray[np.int64], sizes: Array
) -> None:
    for level in range(len(sizes)):
        size = sizes[level]
        for n in range(len(points)):
            x, y, z = points[n, 0], points[n, 1], points[n, 2]
            key = _key(x, y, z, size)
            h = _slot(keys[level], key)
            cell = cells[level, h]
            if keys[level, h] == _EMPTY:
                keys[level, h] = key
                used[level] += 1
                cell[_BIRTH] = birth
            if cell[_COUNT] >= FULL:
                continue
            x -= (math.floor(x / size) + 0.5) * size
            y -= (math.floor(y / size) + 0.5) * size
            z -= (math.floor(z / size) + 0.5) * size
            cell[_COUNT] += 1.0
            cell[_SUM] += x
            cell[_SUM + 1] += y
            cell[_SUM + 2] += z
            cell[_PRODUCTS] += x * x
            cell[_PRODUCTS + 1] += x * y
            cell[_PRODUCTS + 2] += x * z
            cell[_PRODUCTS + 3] += y * y
            cell[_PRODUCTS + 4] += y * z
            cell[_PRODUCTS + 5] += z * z
            count = cell[_COUNT]
            # Refitted whenever the points have become a quarter more.
            step = max(1.0, math.floor(0.25 * count))
            if count >= LEAST and (count % step == 0.0 or count >= FULL):
                _fit(cell, points[n], size)


@njit(cache=True, nogil=True, error_model="numpy")
def _fit(cell: Array, point: Array, size: float) -> None:
    """Fit the plane of a cell that holds `point`: the eigenvector of the smallest eigenvalue of its covariance."""
    n = cell[_COUNT]
    mx, my, mz = cell[_SUM] / n, cell[_SUM + 1] / n, cell[_SUM + 2] / n
    a = cell[_PRODUCTS] / n - mx * mx
    b = cell[_PRODUCTS + 1] / n - mx * my
    c = cell[_PRODUCTS + 2] / n - mx * mz
    d = cell[_PRODUCTS + 3] / n - my * my
    e = cell[_PRODUCTS + 4] / n - my * mz
    f = cell[_PRODUCTS + 5] / n - mz * mz
    # Closed form of the eigenvalues of a symmetric matrix (Smith, CACM 1961).
    q = (a + d + f) / 3.0
    p = math.sqrt(max(((a - q) ** 2 + (d - q) ** 2 + (f - q) ** 2 + 2.0 * (b * b + c * c + e * e)) / 6.0, 1e-30))
    det = (a - q) * ((d - q) * (f - q) - e * e) - b * (b * (f - q) - e * c) + c * (b * e - (d - q) * c)
    angle = math.acos(min(max(det / (2.0 * p**3), -1.0), 1.0)) / 3.0
    high = q + 2.0 * p * math.cos(angle)
    low = q + 2.0 * p * math.cos(angle + 2.0943951023931953)
    middle = 3.0 * q - high - low
    cell[_SPREAD] = max(low, 0.0)
    cell[_PLANE] = 0.0
    if low > FLAT * FLAT or middle < 5.0 * low or middle < (0.12 * size) ** 2:
        return
    # The normal is orthogonal to the rows of A - low I: the longest of their cross products.
    a -= low
    d -= low
    f -= low
    best = 0.0
    for k in range(3):
        if k == 0:
            x, y, z = b * e - c * d, c * b - a * e, a * d - b * b
        elif k == 1:
            x, y, z = b * f - c * e, c * c - a * f, a * e - b * c
        else:
            x, y, z = d * f - e * e, e * c - b * f, b * e - d * c
        length = x * x + y * y + z * z
        if length > best:
            best = length
            scale = 1.0 / math.sqrt(length)
            cell[_NORMAL], cell[_NORMAL + 1], cell[_NORMAL + 2] = x * scale, y * scale, z * scale
    if best == 0.0:
        return
    mx += (math.floor(point[0] / size) + 0.5) * size
    my += (math.floor(point[1] / size) + 0.5) * size
    mz += (math.floor(point[2] / size) + 0.5) * size
    cell[_OFFSET] = cell[_NORMAL] * mx + cell[_NORMAL + 1] * my + cell[_NORMAL + 2] * mz
    cell[_PLANE] = 1.0


@njit(cache=True, nogil=True, error_model="numpy")
def accumulate(
    points: Array,
    R: Array,
    p: Array,
    P: Array,
    keys: NDArray[np.int64],
    cells: Array,
    sizes: Array,
    noise: Array,
    blind: Array,
    A: Array,
    b: Array,
    N: Array,
    told: Array,
) -> None:
    """Sum up what the distances of points from their planes say of a pose; see `match`."""
    for out in (A, N):
        for i in range(out.shape[0]):
            for j in range(out.shape[1]):
                out[i, j] = 0.0
    for i in range(6):
        b[i] = 0.0
    for i in range(4):
        told[i] = 0.0
    h = np.zeros(6)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        wx = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + p[0]
        wy = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + p[1]
        wz = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + p[2]
        for level in range(len(sizes)):
            cell = cells[level, _slot(keys[level], _key(wx, wy, wz, sizes[level]))]
            if cell[_COUNT] < LEAST:
                continue
            if level == 0:
                told[0] += 1.0
            if cell[_PLANE] == 0.0:
                continue
            nx, ny, nz = cell[_NORMAL], cell[_NORMAL + 1], cell[_NORMAL + 2]
            r = nx * wx + ny * wy + nz * wz - cell[_OFFSET]
            # The normal in the sensor's frame; the turn's part is point x normal there.
            lx = R[0, 0] * nx + R[1, 0] * ny + R[2, 0] * nz
            ly = R[0, 1] * nx + R[1, 1] * ny + R[2, 1] * nz
            lz = R[0, 2] * nx + R[1, 2] * ny + R[2, 2] * nz
            h[0], h[1], h[2] = y * lz - z * ly, z * lx - x * lz, x * ly - y * lx
            h[3], h[4], h[5] = nx, ny, nz
            square = x * x + y * y + z * z
            along = (x * lx + y * ly + z * lz) ** 2 / square
            variance = noise[0] * along + noise[1] * square * (1.0 - along) + cell[_SPREAD] / cell[_COUNT]
            believed = variance
            for j in range(6):
                for k in range(6):
                    believed += h[j] * P[j, k] * h[k]
            if r * r > 9.0 * believed + 0.0004:
                break  # it is not of this plane, nor of a smaller one
            # A direction that is known too badly is left out altogether.
            share = blind[0] * nx + blind[1] * ny + blind[2] * nz
            h[3] -= share * blind[0]
            h[4] -= share * blind[1]
            h[5] -= share * blind[2]
            weight = 1.0 / (noise[2] * variance)
            # Cauchy's weight: what is far off counts little.
            weight /= 1.0 + r * r / (6.0 * variance)
            for j in range(6):
                b[j] += weight * h[j] * r
                for k in range(6):
                    A[j, k] += weight * h[j] * h[k]
            N[0, 0] += nx * nx
            N[0, 1] += nx * ny
            N[0, 2] += nx * nz
            N[1, 1] += ny * ny
            N[1, 2] += ny * nz
            N[2, 2] += nz * nz
            told[1] += 1.0
            told[2] += cell[_BIRTH]
            told[3] += r * r / variance
            break
