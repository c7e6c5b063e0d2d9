"""Compiled forward kinematics and distances of spheres; compiled at the first call, then cached on disk.

A model is two flat arrays, since a call costs 0.1 us per array. `ints` begins with the numbers of joints, links,
clusters, spheres and pairs of links, then where each table begins: a table has one place, read as `ints[ints[TABLE] +
i]`, since views of arrays take long to compile. Every joint is a hinge about, or a slide along, the z axis of its own
frame. Body 0 is the base, body j + 1 hangs on joint j.
Distances are between surfaces, negative where spheres overlap by more than they may [m].
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.kernels import njit
from golem.types import Array

Ints = Any
"""(n,) int32, whose numbers are indices."""
Indices = NDArray[np.int64]

LINK_BODY, CLUSTER_FIRST, CLUSTER_BODY, LINK_PAIRS, LINK_PAIR_FIRST = 5, 6, 7, 8, 9
CLUSTER_PAIRS, CLUSTER_PAIR_FIRST, SPHERE_PAIRS = 10, 11, 12
"""Tables of `ints`: body of each link; first sphere and body of each cluster; pairs of links (a, b) and the first of
their pairs of clusters; pairs of clusters (a, b) and the first of their pairs of spheres; pairs of spheres (a, b)."""
LINK_BALLS, CLUSTER_BALLS, BALLS, ALLOWED = 13, 14, 15, 16
"""Tables of `floats`: balls (x, y, z, r) around links, around clusters, and the spheres themselves; by how much the
spheres of each pair of links may overlap."""
HEADER = 17
"""Numbers at the beginning of `ints`; parent and kind of each joint follow."""


@njit(cache=True, nogil=True, error_model="numpy")
def place(q: Array, ints: Ints, floats: Array, R: Array, p: Array) -> None:
    """Write the rotations (n + 1, 9) and positions (n + 1, 3) of the bodies at `q`."""
    n = ints[0]
    for i in range(9):
        R[0, i] = 0.0
    R[0, 0] = R[0, 4] = R[0, 8] = 1.0
    p[0, 0] = p[0, 1] = p[0, 2] = 0.0
    for j in range(n):
        a, slides, f, k = ints[HEADER + j], ints[HEADER + n + j], 12 * j, j + 1
        s, c = (0.0, 1.0) if slides else (math.sin(q[j]), math.cos(q[j]))
        for i in range(3):
            u, v, w = R[a, 3 * i], R[a, 3 * i + 1], R[a, 3 * i + 2]
            x = u * floats[f] + v * floats[f + 3] + w * floats[f + 6]
            y = u * floats[f + 1] + v * floats[f + 4] + w * floats[f + 7]
            z = u * floats[f + 2] + v * floats[f + 5] + w * floats[f + 8]
            R[k, 3 * i] = c * x + s * y
            R[k, 3 * i + 1] = c * y - s * x
            R[k, 3 * i + 2] = z
            p[k, i] = p[a, i] + u * floats[f + 9] + v * floats[f + 10] + w * floats[f + 11]
            if slides:
                p[k, i] += z * q[j]


@njit(cache=True, nogil=True, error_model="numpy")
def put(R: Array, p: Array, b: int, floats: Array, at: int, out: Array, row: int) -> None:
    """Write the ball that begins at `floats[at]` into `out[row]`, (., 4), where body `b` carries it."""
    x, y, z = floats[at], floats[at + 1], floats[at + 2]
    for k in range(3):
        out[row, k] = R[b, 3 * k] * x + R[b, 3 * k + 1] * y + R[b, 3 * k + 2] * z + p[b, k]
    out[row, 3] = floats[at + 3]


@njit(cache=True, nogil=True, error_model="numpy")
def _near(balls: Array, a: int, b: int, margin: float) -> bool:
    x, y, z = balls[a, 0] - balls[b, 0], balls[a, 1] - balls[b, 1], balls[a, 2] - balls[b, 2]
    reach = balls[a, 3] + balls[b, 3] + margin
    return x * x + y * y + z * z <= reach * reach


@njit(cache=True, nogil=True, error_model="numpy")
def bodies_collide(R: Array, p: Array, ints: Ints, floats: Array, margin: float) -> bool:
    """Return whether two tested spheres come as near as `margin` [m], the bodies being where `place` put them."""
    links, clusters = int(np.int64(ints[1])), int(np.int64(ints[2]))
    # Links, clusters, spheres; the last two are placed when they are first asked for.
    placed, around = np.empty((links + clusters + ints[3], 4)), links + clusters
    done = np.zeros(2 * clusters, np.uint8)
    for i in range(links):
        put(R, p, ints[ints[LINK_BODY] + i], floats, ints[LINK_BALLS] + 4 * i, placed, i)
    for i in range(ints[4]):
        reach, pair = margin - float(floats[ints[ALLOWED] + i]), ints[LINK_PAIRS] + 2 * i
        if not _near(placed, ints[pair], ints[pair + 1], reach):
            continue
        for j in range(ints[ints[LINK_PAIR_FIRST] + i], ints[ints[LINK_PAIR_FIRST] + i + 1]):
            pair = ints[CLUSTER_PAIRS] + 2 * j
            for side in range(2):
                c = int(np.int64(ints[pair + side]))
                if not done[clusters + c]:
                    done[clusters + c] = 1
                    put(R, p, ints[ints[CLUSTER_BODY] + c], floats, ints[CLUSTER_BALLS] + 4 * c, placed, links + c)
            if not _near(placed, links + ints[pair], links + ints[pair + 1], reach):
                continue
            for side in range(2):
                c = int(np.int64(ints[pair + side]))
                if not done[c]:
                    done[c] = 1
                    _put_spheres(R, p, c, ints, floats, placed, around)
            for k in range(ints[ints[CLUSTER_PAIR_FIRST] + j], ints[ints[CLUSTER_PAIR_FIRST] + j + 1]):
                two = ints[SPHERE_PAIRS] + 2 * k
                if _near(placed, around + ints[two], around + ints[two + 1], reach):
                    return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _put_spheres(R: Array, p: Array, c: int, ints: Ints, floats: Array, placed: Array, row: int) -> None:
    """Write the spheres of cluster `c` into `placed`, sphere 0 being at `row`."""
    for i in range(ints[ints[CLUSTER_FIRST] + c], ints[ints[CLUSTER_FIRST] + c + 1]):
        put(R, p, ints[ints[CLUSTER_BODY] + c], floats, ints[BALLS] + 4 * i, placed, row + i)


@njit(cache=True, nogil=True, error_model="numpy")
def collides(q: Array, ints: Ints, floats: Array, margin: float) -> bool:
    """Return whether two tested spheres come as near as `margin` [m] at `q`; stops at the first."""
    n = ints[0]
    R, p = np.empty((n + 1, 9)), np.empty((n + 1, 3))
    place(q, ints, floats, R, p)
    return bodies_collide(R, p, ints, floats, margin)


@njit(cache=True, nogil=True, error_model="numpy")
def collides_each(Q: Array, ints: Ints, floats: Array, margin: float, out: NDArray[np.bool_]) -> None:
    """Write into `out` (m,) whether each row of `Q` (m, n) collides."""
    for i in range(len(Q)):
        out[i] = collides(Q[i], ints, floats, margin)


@njit(cache=True, nogil=True, error_model="numpy")
def place_spheres(q: Array, ints: Ints, floats: Array, R: Array, p: Array, placed: Array) -> None:
    """Write bodies, see `place`, and all spheres (m, 4) at `q`."""
    place(q, ints, floats, R, p)
    for c in range(np.int64(ints[2])):
        _put_spheres(R, p, c, ints, floats, placed, 0)


@njit(cache=True, nogil=True, error_model="numpy")
def pair_distances(
    placed_R: Array,
    placed_p: Array,
    placed: Array,
    ints: Ints,
    floats: Array,
    cutoff: float,
    distance: Array,
    spheres: Indices,
) -> None:
    """Write the distance (l,) of every tested pair of links and its nearest spheres (l, 2); `cutoff` where farther."""
    links, clusters = int(np.int64(ints[1])), int(np.int64(ints[2]))
    near = np.empty((links + clusters, 4))
    for i in range(links):
        put(placed_R, placed_p, ints[ints[LINK_BODY] + i], floats, ints[LINK_BALLS] + 4 * i, near, i)
    for c in range(clusters):
        body, ball = ints[ints[CLUSTER_BODY] + c], ints[CLUSTER_BALLS] + 4 * c
        put(placed_R, placed_p, body, floats, ball, near, links + c)
    for i in range(ints[4]):
        allowed, pair = float(floats[ints[ALLOWED] + i]), ints[LINK_PAIRS] + 2 * i
        best = cutoff - allowed
        spheres[i, 0] = spheres[i, 1] = -1
        if _near(near, ints[pair], ints[pair + 1], best):
            for j in range(ints[ints[LINK_PAIR_FIRST] + i], ints[ints[LINK_PAIR_FIRST] + i + 1]):
                pair = ints[CLUSTER_PAIRS] + 2 * j
                if not _near(near, links + ints[pair], links + ints[pair + 1], best):
                    continue
                for k in range(ints[ints[CLUSTER_PAIR_FIRST] + j], ints[ints[CLUSTER_PAIR_FIRST] + j + 1]):
                    a, b = ints[ints[SPHERE_PAIRS] + 2 * k], ints[ints[SPHERE_PAIRS] + 2 * k + 1]
                    if _near(placed, a, b, best):
                        x = placed[a, 0] - placed[b, 0]
                        y = placed[a, 1] - placed[b, 1]
                        z = placed[a, 2] - placed[b, 2]
                        best = math.sqrt(x * x + y * y + z * z) - placed[a, 3] - placed[b, 3]
                        spheres[i, 0], spheres[i, 1] = a, b
        distance[i] = best + allowed


@njit(cache=True, nogil=True, error_model="numpy")
def add_gradient(
    balls: Array, i: int, normal: Array, body: int, sign: float, ints: Ints, R: Array, p: Array,
    out: Array, row: int,
) -> None:  # fmt: skip
    """Add to `out[row]`, (., n), the derivative of sign * normal . middle of ball `i` of a body, by the joints."""
    n = ints[0]
    while body > 0:
        j = body - 1
        ax, ay, az = R[body, 2], R[body, 5], R[body, 8]
        if ints[HEADER + n + j]:
            out[row, j] += sign * (normal[0] * ax + normal[1] * ay + normal[2] * az)
        else:
            x, y, z = balls[i, 0] - p[body, 0], balls[i, 1] - p[body, 1], balls[i, 2] - p[body, 2]
            out[row, j] += sign * (
                normal[0] * (ay * z - az * y) + normal[1] * (az * x - ax * z) + normal[2] * (ax * y - ay * x)
            )
        body = ints[HEADER + j]


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_pairs(
    q: Array,
    ints: Ints,
    floats: Array,
    sphere_body: Indices,
    cutoff: float,
    distance: Array,
    gradient: Array,
    spheres: Indices,
) -> int:
    """Write distance (k,), gradient (k, n) and spheres (k, 2) of the nearest pairs of links; return how many.

    Pairs farther than `cutoff` [m] are left out; the nearest comes first.
    """
    n, most, count = ints[0], len(distance), 0
    R, p = np.empty((n + 1, 9)), np.empty((n + 1, 3))
    placed = np.empty((ints[3], 4))
    place_spheres(q, ints, floats, R, p, placed)
    far, two = np.empty(ints[4]), np.empty((ints[4], 2), np.int64)
    pair_distances(R, p, placed, ints, floats, cutoff, far, two)
    normal = np.empty(3)
    for i in range(ints[4]):
        if two[i, 0] < 0:
            continue
        slot = count
        if count == most:
            slot = farthest(distance)
            if distance[slot] <= far[i]:
                continue
        else:
            count += 1
        a, b = two[i, 0], two[i, 1]
        length = 0.0
        for k in range(3):
            normal[k] = placed[a, k] - placed[b, k]
            length += normal[k] * normal[k]
        length = max(math.sqrt(length), 1e-9)
        for k in range(3):
            normal[k] /= length
        distance[slot], spheres[slot, 0], spheres[slot, 1] = far[i], a, b
        for j in range(n):
            gradient[slot, j] = 0.0
        add_gradient(placed, a, normal, int(sphere_body[a]), 1.0, ints, R, p, gradient, slot)
        add_gradient(placed, b, normal, int(sphere_body[b]), -1.0, ints, R, p, gradient, slot)
    for i in range(1, count):
        for k in range(i, 0, -1):
            if not distance[k] < distance[k - 1]:
                break
            distance[k - 1], distance[k] = distance[k], distance[k - 1]
            for c in range(2):
                spheres[k - 1, c], spheres[k, c] = spheres[k, c], spheres[k - 1, c]
            for j in range(n):
                gradient[k - 1, j], gradient[k, j] = gradient[k, j], gradient[k - 1, j]
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def farthest(distance: Array) -> int:
    """Return where the largest of `distance` (k,) is, the first of several."""
    found = 0
    for i in range(1, len(distance)):
        if distance[i] > distance[found]:
            found = i
    return found
