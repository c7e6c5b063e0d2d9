"""Compiled distances of spheres to shapes and clouds; compiled at the first call, then cached on disk.

A shape is a row of 16: kind, rotation (9) and position (3) of its frame in the base, sizes (3).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.collision.sphere_kernel import (
    BALLS,
    CLUSTER_BALLS,
    CLUSTER_BODY,
    CLUSTER_FIRST,
    Indices,
    Ints,
    add_gradient,
    farthest,
    place,
    place_spheres,
    put,
)
from golem.kernels import njit
from golem.types import Array

Cells = NDArray[np.int32]
Points = NDArray[np.float64] | NDArray[np.float32]

_BOX, _CYLINDER, _SPHERE = 0, 1, 2


class WorldTables(NamedTuple):
    """A world as the kernels read it.

    Attributes:
        shapes: (n, 16), see above.
        balls: (k, 4) mean and reach of the points in each occupied cell of the cloud [m].
        cells: number of each cell's ball, -1 where it is empty.
        steps: how many cells away the nearest occupied one is.
        frame: (4,) corner of the grid and side of a cell [m].
    """

    shapes: Array
    balls: Array
    cells: Cells
    steps: Cells
    frame: Array


@njit(cache=True, nogil=True, error_model="numpy")
def _cell(x: float, y: float, z: float, frame: Array, shape: tuple[int, ...]) -> int:
    """Return the flat index of the cell of a point, -1 for one that is not finite or outside."""
    i, j, k = (x - frame[0]) / frame[3], (y - frame[1]) / frame[3], (z - frame[2]) / frame[3]
    # NaN fails every comparison; what is not negative is cut to its floor.
    if not (i >= 0.0 and j >= 0.0 and k >= 0.0 and i < shape[0] and j < shape[1] and k < shape[2]):
        return -1
    return (int(i) * shape[1] + int(j)) * shape[2] + int(k)


@njit(cache=True, nogil=True, error_model="numpy")
def number_cells(points: Points, frame: Array, cells: Cells) -> int:
    """Number the occupied cells in the order of their first points; return how many there are."""
    flat, count = cells.ravel(), 0
    for i in range(len(points)):
        c = _cell(points[i, 0], points[i, 1], points[i, 2], frame, cells.shape)
        if c >= 0 and flat[c] < 0:
            flat[c] = count
            count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def fill_balls(points: Points, frame: Array, cells: Cells, balls: Array) -> int:
    """Write mean and reach of the points of each cell into `balls` (k, 4); return how many points were used."""
    flat, number = cells.ravel(), np.zeros(len(balls), np.int64)
    for i in range(len(points)):
        c = _cell(points[i, 0], points[i, 1], points[i, 2], frame, cells.shape)
        if c >= 0:
            b = flat[c]
            number[b] += 1
            for k in range(3):
                balls[b, k] += points[i, k]
    for b in range(len(balls)):
        for k in range(3):
            balls[b, k] /= number[b]
    for i in range(len(points)):
        c = _cell(points[i, 0], points[i, 1], points[i, 2], frame, cells.shape)
        if c >= 0:
            b = flat[c]
            x, y, z = points[i, 0] - balls[b, 0], points[i, 1] - balls[b, 1], points[i, 2] - balls[b, 2]
            balls[b, 3] = max(balls[b, 3], x * x + y * y + z * z)
    for b in range(len(balls)):
        balls[b, 3] = math.sqrt(balls[b, 3])
    used = 0
    for b in range(len(balls)):
        used += number[b]
    return used


@njit(cache=True, nogil=True, error_model="numpy")
def _to_shape(x: float, y: float, z: float, shapes: Array, i: int, out: Array) -> float:
    """Return the signed distance of a point from shape `i`, and write the direction in which it grows."""
    x, y, z = x - shapes[i, 10], y - shapes[i, 11], z - shapes[i, 12]
    u = shapes[i, 1] * x + shapes[i, 4] * y + shapes[i, 7] * z
    v = shapes[i, 2] * x + shapes[i, 5] * y + shapes[i, 8] * z
    w = shapes[i, 3] * x + shapes[i, 6] * y + shapes[i, 9] * z
    a, b, c = 0.0, 0.0, 1.0
    if shapes[i, 0] == _BOX:
        du, dv, dw = abs(u) - shapes[i, 13], abs(v) - shapes[i, 14], abs(w) - shapes[i, 15]
        if du > 0.0 or dv > 0.0 or dw > 0.0:
            a, b, c = max(du, 0.0), max(dv, 0.0), max(dw, 0.0)
            d = math.sqrt(a * a + b * b + c * c)
            a, b, c = math.copysign(a / d, u), math.copysign(b / d, v), math.copysign(c / d, w)
        else:
            d = max(max(du, dv), dw)
            a, b, c = 0.0, 0.0, 0.0
            if d == du:
                a = math.copysign(1.0, u)
            elif d == dv:
                b = math.copysign(1.0, v)
            else:
                c = math.copysign(1.0, w)
    elif shapes[i, 0] == _CYLINDER:
        r = math.sqrt(u * u + v * v)
        e, f = (u / r, v / r) if r > 0.0 else (1.0, 0.0)
        dr, dw = r - shapes[i, 13], abs(w) - shapes[i, 14]
        if dr > 0.0 or dw > 0.0:
            g, h = max(dr, 0.0), max(dw, 0.0)
            d = math.sqrt(g * g + h * h)
            a, b, c = e * g / d, f * g / d, math.copysign(h / d, w)
        elif dr > dw:
            d, a, b, c = dr, e, f, 0.0
        else:
            d, a, b, c = dw, 0.0, 0.0, math.copysign(1.0, w)
    elif shapes[i, 0] == _SPHERE:
        r = math.sqrt(u * u + v * v + w * w)
        d = r - shapes[i, 13]
        if r > 0.0:
            a, b, c = u / r, v / r, w / r
    else:
        d = w
    out[0] = shapes[i, 1] * a + shapes[i, 2] * b + shapes[i, 3] * c
    out[1] = shapes[i, 4] * a + shapes[i, 5] * b + shapes[i, 6] * c
    out[2] = shapes[i, 7] * a + shapes[i, 8] * b + shapes[i, 9] * c
    return d


@njit(cache=True, nogil=True, error_model="numpy")
def _to_cloud(x: float, y: float, z: float, reach: float, world: WorldTables, out: Array) -> float:
    """Return the distance of a point from the nearest ball of a cloud, or `reach` if none is nearer."""
    balls, cells, steps, frame = world.balls, world.cells, world.steps, world.frame
    size, h = cells.shape, frame[3]
    # The block of cells to look at, and the nearest cell of the grid: a point may be outside of it.
    low, high, near = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3, np.int64)
    outside = 0.0
    # Balls reach beyond their cells by less than a diagonal.
    spill = 1.74 * h
    for k in range(3):
        along = x if k == 0 else y if k == 1 else z
        f = (along - frame[k]) / h
        near[k] = min(max(int(math.floor(f)), 0), size[k] - 1)
        outside = max(outside, max((f - size[k]) * h, -f * h))
        low[k] = max(int(math.floor((along - reach - spill - frame[k]) / h)), 0)
        high[k] = min(int(math.floor((along + reach + spill - frame[k]) / h)) + 1, size[k])
    if max(outside, (steps[near[0], near[1], near[2]] - 1) * h) > reach + spill:
        return reach
    best = reach
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            k = low[2]
            while k < high[2]:
                skip = steps[i, j, k]
                if skip:
                    k += skip
                    continue
                b = cells[i, j, k]
                u, v, w = x - balls[b, 0], y - balls[b, 1], z - balls[b, 2]
                length = math.sqrt(u * u + v * v + w * w)
                if length - balls[b, 3] < best:
                    best = length - balls[b, 3]
                    length = max(length, 1e-9)
                    out[0], out[1], out[2] = u / length, v / length, w / length
                k += 1
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def _to_world(placed: Array, row: int, world: WorldTables, cutoff: float, out: Array) -> float:
    """Return the distance of ball `row` of `placed` from the world, or `cutoff`; write the direction of its growth."""
    best, found = cutoff, np.zeros(3)
    x, y, z, r = placed[row, 0], placed[row, 1], placed[row, 2], placed[row, 3]
    out[0] = out[1] = out[2] = 0.0
    for i in range(len(world.shapes) + (len(world.balls) > 0)):
        if i < len(world.shapes):
            d = _to_shape(x, y, z, world.shapes, i, found) - r
        else:
            d = _to_cloud(x, y, z, best + r, world, found) - r
        if d < best:
            best = d
            for k in range(3):
                out[k] = found[k]
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def ball_distances(placed: Array, world: WorldTables, cutoff: float, distance: Array, direction: Array) -> None:
    """Write distance (n,) and direction (n, 3) of balls (n, 4), see `World.distance`."""
    out = np.empty(3)
    for i in range(len(placed)):
        distance[i] = _to_world(placed, i, world, cutoff, out)
        for k in range(3):
            direction[i, k] = out[k]


@njit(cache=True, nogil=True, error_model="numpy")
def bodies_hit_world(R: Array, p: Array, ints: Ints, floats: Array, world: WorldTables, margin: float) -> bool:
    """Return whether a moving sphere comes as near as `margin` [m] to the world, the bodies being where they are put.

    A cluster's ball is asked first, and its spheres only where that is near.
    """
    out, placed = np.empty(3), np.empty((1, 4))
    for c in range(ints[2]):
        b, first = ints[ints[CLUSTER_BODY] + c], ints[CLUSTER_FIRST] + c
        if b == 0:
            continue
        # The cluster's ball, then its spheres.
        for i in range(ints[first] - 1, ints[first + 1]):
            around = i < ints[first]
            put(R, p, b, floats, ints[CLUSTER_BALLS] + 4 * c if around else ints[BALLS] + 4 * i, placed, 0)
            far = _to_world(placed, 0, world, margin + 1e-9, out) > margin
            if around and far:
                break
            if not (around or far):
                return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def world_collides(q: Array, ints: Ints, floats: Array, world: WorldTables, margin: float) -> bool:
    """Return whether a sphere of a moving body comes as near as `margin` [m] to the world at `q`."""
    n = ints[0]
    R, p = np.empty((n + 1, 9)), np.empty((n + 1, 3))
    place(q, ints, floats, R, p)
    return bodies_hit_world(R, p, ints, floats, world, margin)


@njit(cache=True, nogil=True, error_model="numpy")
def world_collides_each(
    Q: Array, ints: Ints, floats: Array, world: WorldTables, margin: float, out: NDArray[np.bool_]
) -> None:
    """Write into `out` (m,) whether each row of `Q` (m, n) collides with the world."""
    for i in range(len(Q)):
        out[i] = world_collides(Q[i], ints, floats, world, margin)


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_world(
    q: Array,
    ints: Ints,
    floats: Array,
    moving: Indices,
    sphere_body: Indices,
    sphere_link: Indices,
    world: WorldTables,
    cutoff: float,
    distance: Array,
    gradient: Array,
    spheres: Indices,
) -> int:
    """Write distance (k,), gradient (k, n) and sphere (k,) of the links nearest to the world; return how many."""
    n, links, most = ints[0], ints[1], len(distance)
    R, p, placed = np.empty((n + 1, 9)), np.empty((n + 1, 3)), np.empty((ints[3], 4))
    place_spheres(q, ints, floats, R, p, placed)
    best, which = np.full(links, cutoff), np.full(links, -1)
    normals, out = np.zeros((links, 3)), np.empty(3)
    for m in range(len(moving)):
        i = moving[m]
        link = sphere_link[i]
        d = _to_world(placed, i, world, float(best[link]), out)
        if d < best[link]:
            best[link], which[link] = d, i
            for k in range(3):
                normals[link, k] = out[k]
    count = 0
    for link in range(links):
        if which[link] < 0:
            continue
        slot = count
        if count == most:
            slot = farthest(distance)
            if distance[slot] <= best[link]:
                continue
        else:
            count += 1
        i = which[link]
        distance[slot], spheres[slot] = best[link], i
        for j in range(n):
            gradient[slot, j] = 0.0
        add_gradient(placed, i, normals[link], int(sphere_body[i]), 1.0, ints, R, p, gradient, slot)
    return count
