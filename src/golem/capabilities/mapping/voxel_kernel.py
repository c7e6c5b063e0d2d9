"""Compiled voxel updates: hits, rays that clear, and the map of the floor; compiled once, then cached on disk.

Voxels are log odds in steps, an int8 each, `voxels[row, column, layer]`; zero is unknown. Every scan has a number; a
voxel's `stamp` is that of the last scan that changed it, so that one scan counts once, and a hit before a ray.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from golem.kernels import njit
from golem.types import Array

Voxels = NDArray[np.int8]
Stamps = NDArray[np.uint16]
HIT, MISS, MOST, LEAST = 4, 1, 12, -8
"""Steps of the log odds per hit and per ray that passes, and their bounds [own: a person who walked on is forgotten
after some seconds, the edge of a board that one scan in four hits is not]."""
OCCUPIED = 6
"""Steps from which a voxel counts as occupied: two hits."""
UNKNOWN, FREE, FULL = -1, 0, 100
"""What a cell of the floor's map may be; see `OccupancyGrid`."""


@njit(cache=True, nogil=True, error_model="numpy")
def within(points: Array, origin: Array, reach: float) -> Array:
    """Return the points (n, 3) less than `reach` [m] from `origin` (3,); those that are not finite are not."""
    out = np.empty(points.shape)
    n = 0
    for i in range(len(points)):
        x, y, z = points[i, 0] - origin[0], points[i, 1] - origin[1], points[i, 2] - origin[2]
        if x * x + y * y + z * z < reach * reach:
            for a in range(3):
                out[n, a] = points[i, a]
            n += 1
    return out[:n]


@njit(cache=True, nogil=True, error_model="numpy")
def span(points: Array, origin: Array) -> tuple[Array, Array]:
    """Return the least and the greatest x and y, (2,) each, of `origin` (3,) and points (n, 3)."""
    low, high = np.empty(2), np.empty(2)
    for a in range(2):
        low[a] = high[a] = origin[a]
    for i in range(len(points)):
        for a in range(2):
            low[a], high[a] = min(low[a], points[i, a]), max(high[a], points[i, a])
    return low, high


@njit(cache=True, nogil=True, error_model="numpy")
def mark(voxels: Voxels, stamps: Stamps, points: Array, corner: Array, resolution: float, number: int) -> None:
    """Count each voxel that a point (n, 3) lies in as hit; `corner` (3,) is that of voxel [0, 0, 0]."""
    rows, columns, layers = voxels.shape
    for i in range(len(points)):
        c = int(math.floor((points[i, 0] - corner[0]) / resolution))
        r = int(math.floor((points[i, 1] - corner[1]) / resolution))
        k = int(math.floor((points[i, 2] - corner[2]) / resolution))
        if 0 <= r < rows and 0 <= c < columns and 0 <= k < layers and stamps[r, c, k] != number:
            stamps[r, c, k] = number
            voxels[r, c, k] = min(voxels[r, c, k] + HIT, MOST)


@njit(cache=True, nogil=True, error_model="numpy")
def clear(
    voxels: Voxels, stamps: Stamps, points: Array, origin: Array, corner: Array, resolution: float, number: int
) -> None:
    """Count each voxel as free that a ray from `origin` (3,) to a point (n, 3) passes (Amanatides and Woo, 1987).

    The two voxels before a point are left as they are: a ray that grazes a wall shall not clear it.
    """
    rows, columns, layers = voxels.shape
    flat_voxels, flat_stamps = voxels.reshape(-1), stamps.reshape(-1)
    # Three scalars in place of an array each: these stay in registers.
    x, y, z = origin[0], origin[1], origin[2]
    begin_x, begin_y, begin_z = (
        (x - corner[0]) / resolution,
        (y - corner[1]) / resolution,
        (z - corner[2]) / resolution,
    )
    for i in range(len(points)):
        along_x, along_y, along_z = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
        length = math.sqrt(along_x**2 + along_y**2 + along_z**2)
        if not length > resolution:
            continue
        c, step_c, next_x, stride_x = _axis(begin_x, along_x / length, resolution)
        r, step_r, next_y, stride_y = _axis(begin_y, along_y / length, resolution)
        k, step_k, next_z, stride_z = _axis(begin_z, along_z / length, resolution)
        end = length - 2.0 * resolution
        t = 0.0
        # A ray whose ends are inside, and not at the border, stays inside.
        last_c = int(math.floor((points[i, 0] - corner[0]) / resolution))
        last_r = int(math.floor((points[i, 1] - corner[1]) / resolution))
        last_k = int(math.floor((points[i, 2] - corner[2]) / resolution))
        inside = 0 < min(r, last_r) and max(r, last_r) < rows - 1 and 0 < min(c, last_c)
        inside = inside and max(c, last_c) < columns - 1 and 0 < min(k, last_k) and max(k, last_k) < layers - 1
        at, jump_r, jump_c = (r * columns + c) * layers + k, step_r * columns * layers, step_c * layers
        while t < end:
            here = inside or (0 <= r < rows and 0 <= c < columns and 0 <= k < layers)
            if here and flat_stamps[at] != number:
                flat_stamps[at] = number
                flat_voxels[at] = max(flat_voxels[at] - MISS, LEAST)
            t = min(next_x, next_y)
            if next_z < t:
                t = next_z
                next_z += stride_z
                k += step_k
                at += step_k
            elif next_y < next_x:
                next_y += stride_y
                r += step_r
                at += jump_r
            else:
                next_x += stride_x
                c += step_c
                at += jump_c


@njit(cache=True, nogil=True, error_model="numpy")
def _axis(begin: float, along: float, resolution: float) -> tuple[int, int, float, float]:
    """Return where a ray begins on one axis, its step, the way to the next border, and from border to border [m].

    `begin` is in voxels, `along` the ray's direction cosine.
    """
    position = int(math.floor(begin))
    step = 1 if along > 0.0 else -1
    if abs(along) < 1e-9:
        return position, step, np.inf, np.inf
    border = position + (1 if along > 0.0 else 0)
    return position, step, (border - begin) * resolution / along, abs(resolution / along)


@njit(cache=True, nogil=True, error_model="numpy")
def flatten(
    voxels: Voxels,
    cells: NDArray[np.int8],
    box: NDArray[np.int64],
    corner: Array,
    resolution: float,
    floor: Array,
    band: Array,
) -> None:
    """Write the map of the floor into `cells` (rows, columns), within the rows and columns of `box` (4,).

    A cell is full where a voxel within the height `band` (2,) above the floor z = floor[0] x + floor[1] y + floor[2] is
    occupied. It is free where the floor was seen, or something free not higher than the lower 0.5 m of the band.
    """
    layers = voxels.shape[2]
    for r in range(box[0], box[1]):
        for c in range(box[2], box[3]):
            x, y = corner[0] + (c + 0.5) * resolution, corner[1] + (r + 0.5) * resolution
            ground = (floor[0] * x + floor[1] * y + floor[2] - corner[2]) / resolution
            low = max(0, int(math.ceil(ground + band[0] / resolution)))
            high = min(layers, int(math.floor(ground + band[1] / resolution)))
            seen, full = False, False
            for k in range(max(0, int(ground) - 2), low):
                seen = seen or voxels[r, c, k] != 0
            for k in range(low, high):
                v = voxels[r, c, k]
                if v >= OCCUPIED:
                    full = True
                    break
                seen = seen or (v < 0 and (k - low) * resolution < 0.5)
            cells[r, c] = FULL if full else FREE if seen else UNKNOWN
