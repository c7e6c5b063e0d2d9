"""Compiled distances of spheres to shapes and clouds; compiled at the first call, then cached on disk.

A shape is a row of 16: kind, rotation (9) and position (3) of its frame in the base, sizes (3).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from golem.capabilities.collision.sphere_kernel import (
    Indices,
    Ints,
    add_gradient,
    place,
    place_spheres,
    put,
    views,
)
from golem.types import Array

Cells = NDArray[np.int32]
Points = NDArray[np.float64] | NDArray[np.float32]

_BOX, _CYLINDER, _SPHERE = 0, 1, 2


@njit(cache=True, nogil=True)
def _cell(x: float, y: float, z: float, frame: Array, shape: tuple[int, ...]) -> Any:
    """Return the flat index of the cell of a point, -1 for one that is not finite or outside."""
    i = np.floor((x - frame[0]) / frame[3])
    j = np.floor((y - frame[1]) / frame[3])
    k = np.floor((z - frame[2]) / frame[3])
    # NaN fails every comparison.
    if not (i >= 0.0 and j >= 0.0 and k >= 0.0 and i < shape[0] and j < shape[1] and k < shape[2]):
        return np.int64(-1)
    return (np.int64(i) * shape[1] + np.int64(j)) * shape[2] + np.int64(k)


@njit(cache=True, nogil=True)
def number_cells(points: Points, frame: Array, cells: Cells) -> int:
    """Number the occupied cells in the order of their first points; return how many there are."""
    flat, count = cells.ravel(), 0
    for i in range(len(points)):
        c = _cell(points[i, 0], points[i, 1], points[i, 2], frame, cells.shape)
        if c >= 0 and flat[c] < 0:
            flat[c] = count
            count += 1
    return count


@njit(cache=True, nogil=True)
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
        balls[b, 3] = np.sqrt(balls[b, 3])
    return number.sum()


@njit(cache=True, nogil=True)
def _to_shape(x: float, y: float, z: float, s: Array, out: Array) -> float:
    """Return the signed distance of a point from a shape, and write the direction in which it grows."""
    x, y, z = x - s[10], y - s[11], z - s[12]
    u = s[1] * x + s[4] * y + s[7] * z
    v = s[2] * x + s[5] * y + s[8] * z
    w = s[3] * x + s[6] * y + s[9] * z
    a, b, c = 0.0, 0.0, 1.0
    if s[0] == _BOX:
        du, dv, dw = abs(u) - s[13], abs(v) - s[14], abs(w) - s[15]
        if du > 0.0 or dv > 0.0 or dw > 0.0:
            a, b, c = max(du, 0.0), max(dv, 0.0), max(dw, 0.0)
            d = np.sqrt(a * a + b * b + c * c)
            a, b, c = np.copysign(a / d, u), np.copysign(b / d, v), np.copysign(c / d, w)
        else:
            d = max(du, dv, dw)
            a, b, c = 0.0, 0.0, 0.0
            if d == du:
                a = np.copysign(1.0, u)
            elif d == dv:
                b = np.copysign(1.0, v)
            else:
                c = np.copysign(1.0, w)
    elif s[0] == _CYLINDER:
        r = np.sqrt(u * u + v * v)
        e, f = (u / r, v / r) if r > 0.0 else (1.0, 0.0)
        dr, dw = r - s[13], abs(w) - s[14]
        if dr > 0.0 or dw > 0.0:
            g, h = max(dr, 0.0), max(dw, 0.0)
            d = np.sqrt(g * g + h * h)
            a, b, c = e * g / d, f * g / d, np.copysign(h / d, w)
        elif dr > dw:
            d, a, b, c = dr, e, f, 0.0
        else:
            d, a, b, c = dw, 0.0, 0.0, np.copysign(1.0, w)
    elif s[0] == _SPHERE:
        r = np.sqrt(u * u + v * v + w * w)
        d = r - s[13]
        if r > 0.0:
            a, b, c = u / r, v / r, w / r
    else:
        d = w
    out[0] = s[1] * a + s[2] * b + s[3] * c
    out[1] = s[4] * a + s[5] * b + s[6] * c
    out[2] = s[7] * a + s[8] * b + s[9] * c
    return d


@njit(cache=True, nogil=True)
def _to_cloud(
    x: float,
    y: float,
    z: float,
    reach: float,
    balls: Array,
    cells: Cells,
    steps: Cells,
    frame: Array,
    out: Array,
) -> float:
    """Return the distance of a point from the nearest ball of a cloud, or `reach` if none is nearer."""
    size, h = cells.shape, frame[3]
    low = np.empty(3, np.int64)
    high = np.empty(3, np.int64)
    # The nearest cell of the grid: a point may be outside of it.
    outside = 0.0
    near = np.empty(3, np.int64)
    point = (x, y, z)
    for k in range(3):
        f = (point[k] - frame[k]) / h
        near[k] = min(max(np.int64(np.floor(f)), 0), size[k] - 1)
        outside = max(outside, (f - size[k]) * h, -f * h)
    # Balls reach beyond their cells by less than a diagonal.
    spill = 1.74 * h
    if max(outside, (steps[near[0], near[1], near[2]] - 1) * h) > reach + spill:
        return reach
    for k in range(3):
        low[k] = max(np.int64(np.floor((point[k] - reach - spill - frame[k]) / h)), 0)
        high[k] = min(np.int64(np.floor((point[k] + reach + spill - frame[k]) / h)) + 1, size[k])
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
                length = np.sqrt(u * u + v * v + w * w)
                if length - balls[b, 3] < best:
                    best = length - balls[b, 3]
                    length = max(length, 1e-9)
                    out[0], out[1], out[2] = u / length, v / length, w / length
                k += 1
    return best


@njit(cache=True, nogil=True)
def _to_world(
    ball: Array,
    shapes: Array,
    balls: Array,
    cells: Cells,
    steps: Cells,
    frame: Array,
    cutoff: float,
    out: Array,
) -> float:
    best, found = cutoff, np.zeros(3)
    out[0] = out[1] = out[2] = 0.0
    for i in range(len(shapes)):
        d = _to_shape(ball[0], ball[1], ball[2], shapes[i], found) - ball[3]
        if d < best:
            best = d
            out[0], out[1], out[2] = found[0], found[1], found[2]
    if len(balls):
        d = _to_cloud(ball[0], ball[1], ball[2], best + ball[3], balls, cells, steps, frame, found) - ball[3]
        if d < best:
            best = d
            out[0], out[1], out[2] = found[0], found[1], found[2]
    return best


@njit(cache=True, nogil=True)
def ball_distances(
    placed: Array,
    shapes: Array,
    balls: Array,
    cells: Cells,
    steps: Cells,
    frame: Array,
    cutoff: float,
    distance: Array,
    direction: Array,
) -> None:
    """Write distance (n,) and direction (n, 3) of balls (n, 4), see `World.distance`."""
    for i in range(len(placed)):
        distance[i] = _to_world(placed[i], shapes, balls, cells, steps, frame, cutoff, direction[i])


@njit(cache=True, nogil=True)
def bodies_hit_world(
    R: Array,
    p: Array,
    ints: Ints,
    floats: Array,
    shapes: Array,
    balls: Array,
    cells: Cells,
    steps: Cells,
    frame: Array,
    margin: float,
) -> bool:
    """Return whether a moving sphere comes as near as `margin` [m] to the world, the bodies being where they are put.

    A cluster's ball is asked first, and its spheres only where that is near.
    """
    tables = views(ints, floats)
    cluster_first, cluster_body, cluster_balls, spheres = tables[1], tables[2], tables[9], tables[10]
    out, placed = np.empty(3), np.empty((1, 4))
    for c in range(ints[2]):
        b = cluster_body[c]
        if b == 0:
            continue
        put(R, p, b, cluster_balls, c, placed[0])
        if _to_world(placed[0], shapes, balls, cells, steps, frame, margin + 1e-9, out) > margin:
            continue
        for i in range(cluster_first[c], cluster_first[c + 1]):
            put(R, p, b, spheres, i, placed[0])
            if _to_world(placed[0], shapes, balls, cells, steps, frame, margin + 1e-9, out) <= margin:
                return True
    return False


@njit(cache=True, nogil=True)
def world_collides(
    q: Array,
    ints: Ints,
    floats: Array,
    shapes: Array,
    balls: Array,
    cells: Cells,
    steps: Cells,
    frame: Array,
    margin: float,
) -> bool:
    """Return whether a sphere of a moving body comes as near as `margin` [m] to the world at `q`."""
    n = ints[0]
    R, p = np.empty((n + 1, 9)), np.empty((n + 1, 3))
    place(q, ints, floats, R, p)
    return bodies_hit_world(R, p, ints, floats, shapes, balls, cells, steps, frame, margin)


@njit(cache=True, nogil=True)
def world_collides_each(
    Q: Array,
    ints: Ints,
    floats: Array,
    shapes: Array,
    balls: Array,
    cells: Cells,
    steps: Cells,
    frame: Array,
    margin: float,
    out: NDArray[np.bool_],
) -> None:
    """Write into `out` (m,) whether each row of `Q` (m, n) collides with the world."""
    for i in range(len(Q)):
        out[i] = world_collides(Q[i], ints, floats, shapes, balls, cells, steps, frame, margin)


@njit(cache=True, nogil=True)
def nearest_world(
    q: Array,
    ints: Ints,
    floats: Array,
    moving: Indices,
    sphere_body: Indices,
    sphere_link: Indices,
    shapes: Array,
    balls: Array,
    cells: Cells,
    steps: Cells,
    frame: Array,
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
    for i in moving:
        link = sphere_link[i]
        d = _to_world(placed[i], shapes, balls, cells, steps, frame, float(best[link]), out)
        if d < best[link]:
            best[link], which[link] = d, i
            normals[link] = out
    count = 0
    for link in range(links):
        if which[link] < 0:
            continue
        slot = count
        if count == most:
            slot = int(distance[:most].argmax())
            if distance[slot] <= best[link]:
                continue
        else:
            count += 1
        i = which[link]
        distance[slot], spheres[slot] = best[link], i
        gradient[slot] = 0.0
        add_gradient(placed[i], normals[link], int(sphere_body[i]), 1.0, ints, R, p, gradient[slot])
    return count
