"""Compiled forward kinematics and distances of spheres; compiled at the first call, then cached on disk.

A model is two flat arrays, since a call costs 0.1 us per array. `ints` begins with the numbers of joints, links,
clusters, spheres, pairs of links, pairs of clusters and pairs of spheres; `views` cuts both into tables. Every joint is
a hinge about, or a slide along, the z axis of its own frame. Body 0 is the base, body j + 1 hangs on joint j.
Distances are between surfaces, negative where spheres overlap by more than they may [m].
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from golem.types import Array

Ints = NDArray[np.int32]
Indices = NDArray[np.int64]

HEADER = 7
"""Numbers at the beginning of `ints`."""


@njit(cache=True, nogil=True, inline="always")
def place(q: Array, ints: Ints, floats: Array, R: Array, p: Array) -> None:
    """Write the rotations (n + 1, 9) and positions (n + 1, 3) of the bodies at `q`."""
    n = ints[0]
    for i in range(9):
        R[0, i] = 0.0
    R[0, 0] = R[0, 4] = R[0, 8] = 1.0
    p[0, 0] = p[0, 1] = p[0, 2] = 0.0
    for j in range(n):
        a, slides, f, k = ints[HEADER + j], ints[HEADER + n + j], 12 * j, j + 1
        s, c = (0.0, 1.0) if slides else (np.sin(q[j]), np.cos(q[j]))
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


@njit(cache=True, nogil=True, inline="always")
def views(ints: Ints, floats: Array) -> tuple[Any, ...]:
    """Return the tables of a model.

    Returns:
        body of each link; first sphere of each cluster, body of each cluster; pairs of links (a, b) and the first of
        their pairs of clusters; pairs of clusters (a, b) and the first of their pairs of spheres; pairs of spheres
        (a, b); balls (x, y, z, r) around links, around clusters, and the spheres themselves; by how much the spheres
        of each pair of links may overlap.
    """
    n, links, clusters, spheres, lp, cp, sp = ints[0], ints[1], ints[2], ints[3], ints[4], ints[5], ints[6]
    at = HEADER + 2 * n
    link_body = ints[at : at + links]
    at += links
    cluster_first = ints[at : at + clusters + 1]
    at += clusters + 1
    cluster_body = ints[at : at + clusters]
    at += clusters
    link_pairs = ints[at : at + 2 * lp]
    at += 2 * lp
    link_pair_first = ints[at : at + lp + 1]
    at += lp + 1
    cluster_pairs = ints[at : at + 2 * cp]
    at += 2 * cp
    cluster_pair_first = ints[at : at + cp + 1]
    at += cp + 1
    sphere_pairs = ints[at : at + 2 * sp]
    f = 12 * n
    link_balls = floats[f : f + 4 * links]
    f += 4 * links
    cluster_balls = floats[f : f + 4 * clusters]
    f += 4 * clusters
    balls = floats[f : f + 4 * spheres]
    allowed = floats[f + 4 * spheres :]
    return (
        link_body,
        cluster_first,
        cluster_body,
        link_pairs,
        link_pair_first,
        cluster_pairs,
        cluster_pair_first,
        sphere_pairs,
        link_balls,
        cluster_balls,
        balls,
        allowed,
    )


@njit(cache=True, nogil=True, inline="always")
def put(R: Array, p: Array, b: int, local: Array, i: int, out: Array) -> None:
    """Write ball `i` of `local`, a flat table, into `out` (4,) where body `b` carries it."""
    x, y, z = local[4 * i], local[4 * i + 1], local[4 * i + 2]
    for k in range(3):
        out[k] = R[b, 3 * k] * x + R[b, 3 * k + 1] * y + R[b, 3 * k + 2] * z + p[b, k]
    out[3] = local[4 * i + 3]


@njit(cache=True, nogil=True, inline="always")
def _near(one: Array, a: int, other: Array, b: int, margin: float) -> bool:
    x, y, z = one[a, 0] - other[b, 0], one[a, 1] - other[b, 1], one[a, 2] - other[b, 2]
    reach = one[a, 3] + other[b, 3] + margin
    return x * x + y * y + z * z <= reach * reach


@njit(cache=True, nogil=True, inline="always")
def _spread(
    c: int,
    cluster_first: Ints,
    cluster_body: Ints,
    balls: Array,
    R: Array,
    p: Array,
    placed: Array,
    done: NDArray[np.uint8],
) -> None:
    if not done[c]:
        done[c] = 1
        for i in range(cluster_first[c], cluster_first[c + 1]):
            put(R, p, cluster_body[c], balls, i, placed[i])


@njit(cache=True, nogil=True)
def bodies_collide(R: Array, p: Array, ints: Ints, floats: Array, margin: float) -> bool:
    """Return whether two tested spheres come as near as `margin` [m], the bodies being where `place` put them."""
    links, clusters, spheres = ints[1], ints[2], ints[3]
    tables = views(ints, floats)
    link_body, cluster_first, cluster_body, link_pairs, link_pair_first = tables[:5]
    cluster_pairs, cluster_pair_first, sphere_pairs, link_balls, cluster_balls, balls, allowed = tables[5:]
    room = np.empty((links + clusters + spheres, 4))
    placed_links, placed_clusters = room[:links], room[links : links + clusters]
    placed = room[links + clusters :]
    done = np.zeros(2 * clusters, np.uint8)
    for i in range(links):
        put(R, p, link_body[i], link_balls, i, placed_links[i])
    for i in range(ints[4]):
        reach = margin - allowed[i]
        if not _near(placed_links, link_pairs[2 * i], placed_links, link_pairs[2 * i + 1], reach):
            continue
        for j in range(link_pair_first[i], link_pair_first[i + 1]):
            a, b = cluster_pairs[2 * j], cluster_pairs[2 * j + 1]
            for c in (a, b):
                if not done[clusters + c]:
                    done[clusters + c] = 1
                    put(R, p, cluster_body[c], cluster_balls, c, placed_clusters[c])
            if not _near(placed_clusters, a, placed_clusters, b, reach):
                continue
            _spread(a, cluster_first, cluster_body, balls, R, p, placed, done)
            _spread(b, cluster_first, cluster_body, balls, R, p, placed, done)
            for k in range(cluster_pair_first[j], cluster_pair_first[j + 1]):
                if _near(placed, sphere_pairs[2 * k], placed, sphere_pairs[2 * k + 1], reach):
                    return True
    return False


@njit(cache=True, nogil=True)
def collides(q: Array, ints: Ints, floats: Array, margin: float) -> bool:
    """Return whether two tested spheres come as near as `margin` [m] at `q`; stops at the first."""
    n = ints[0]
    R, p = np.empty((n + 1, 9)), np.empty((n + 1, 3))
    place(q, ints, floats, R, p)
    return bodies_collide(R, p, ints, floats, margin)


@njit(cache=True, nogil=True)
def collides_each(Q: Array, ints: Ints, floats: Array, margin: float, out: NDArray[np.bool_]) -> None:
    """Write into `out` (m,) whether each row of `Q` (m, n) collides."""
    for i in range(len(Q)):
        out[i] = collides(Q[i], ints, floats, margin)


@njit(cache=True, nogil=True)
def place_spheres(q: Array, ints: Ints, floats: Array, R: Array, p: Array, placed: Array) -> None:
    """Write bodies, see `place`, and all spheres (m, 4) at `q`."""
    tables = views(ints, floats)
    cluster_first, cluster_body, balls = tables[1], tables[2], tables[10]
    place(q, ints, floats, R, p)
    for c in range(ints[2]):
        for i in range(cluster_first[c], cluster_first[c + 1]):
            put(R, p, cluster_body[c], balls, i, placed[i])


@njit(cache=True, nogil=True)
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
    links, clusters = ints[1], ints[2]
    tables = views(ints, floats)
    link_body, cluster_body, link_pairs, link_pair_first = tables[0], tables[2], tables[3], tables[4]
    cluster_pairs, cluster_pair_first, sphere_pairs, link_balls, cluster_balls = tables[5:10]
    allowed = tables[11]
    near_links, near_clusters = np.empty((links, 4)), np.empty((clusters, 4))
    for i in range(links):
        put(placed_R, placed_p, link_body[i], link_balls, i, near_links[i])
    for i in range(clusters):
        put(placed_R, placed_p, cluster_body[i], cluster_balls, i, near_clusters[i])
    for i in range(ints[4]):
        best = cutoff - allowed[i]
        spheres[i, 0] = spheres[i, 1] = -1
        if _near(near_links, link_pairs[2 * i], near_links, link_pairs[2 * i + 1], best):
            for j in range(link_pair_first[i], link_pair_first[i + 1]):
                if not _near(
                    near_clusters, cluster_pairs[2 * j], near_clusters, cluster_pairs[2 * j + 1], best
                ):
                    continue
                for k in range(cluster_pair_first[j], cluster_pair_first[j + 1]):
                    a, b = sphere_pairs[2 * k], sphere_pairs[2 * k + 1]
                    if _near(placed, a, placed, b, best):
                        x = placed[a, 0] - placed[b, 0]
                        y = placed[a, 1] - placed[b, 1]
                        z = placed[a, 2] - placed[b, 2]
                        best = np.sqrt(x * x + y * y + z * z) - placed[a, 3] - placed[b, 3]
                        spheres[i, 0], spheres[i, 1] = a, b
        distance[i] = best + allowed[i]


@njit(cache=True, nogil=True)
def add_gradient(
    point: Array, normal: Array, body: int, sign: float, ints: Ints, R: Array, p: Array, row: Array
) -> None:
    """Add to `row` (n,) the derivative of sign * normal . point, a point of a body, by the joints."""
    n = ints[0]
    while body > 0:
        j = body - 1
        ax, ay, az = R[body, 2], R[body, 5], R[body, 8]
        if ints[HEADER + n + j]:
            row[j] += sign * (normal[0] * ax + normal[1] * ay + normal[2] * az)
        else:
            x, y, z = point[0] - p[body, 0], point[1] - p[body, 1], point[2] - p[body, 2]
            row[j] += sign * (
                normal[0] * (ay * z - az * y) + normal[1] * (az * x - ax * z) + normal[2] * (ax * y - ay * x)
            )
        body = ints[HEADER + j]


@njit(cache=True, nogil=True)
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

    Pairs farther than `cutoff` [m] are left out; those that are left come in no particular order.
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
            slot = int(distance[:most].argmax())
            if distance[slot] <= far[i]:
                continue
        else:
            count += 1
        a, b = two[i]
        length = 0.0
        for k in range(3):
            normal[k] = placed[a, k] - placed[b, k]
            length += normal[k] * normal[k]
        normal /= max(np.sqrt(length), 1e-9)
        distance[slot], spheres[slot, 0], spheres[slot, 1] = far[i], a, b
        gradient[slot] = 0.0
        add_gradient(placed[a], normal, int(sphere_body[a]), 1.0, ints, R, p, gradient[slot])
        add_gradient(placed[b], normal, int(sphere_body[b]), -1.0, ints, R, p, gradient[slot])
    return count
