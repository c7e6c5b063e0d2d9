"""Compiled validity of postures, segments and trees; compiled at the first call, then cached on disk.

A space is the tuple `Space` of arrays: the model and the world as the collision kernels read them, the range of the
joints, rules for hands and centre of mass, and two margins. A rule is a row of 12: its kind, a body, and numbers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from golem.capabilities.collision.sphere_kernel import Indices, Ints, bodies_collide, place
from golem.capabilities.collision.world_kernel import WorldTables, bodies_hit_world
from golem.kernels import njit
from golem.types import Array

FREE, RANGE, ITSELF, WORLD, RULE = 0, 1, 2, 3, 4
"""Why a posture is not free: beyond a joint's range, in itself, in the world; `RULE` + i: against rule i."""
IN_BOX, ALONG_AXIS, BALANCED = 0, 1, 2
"""Kinds of rules. A point (3) of a body within a box (3, 3). An axis (3) of a body within an angle, given by its
cosine, of an axis of the base (3). The centre of mass within a distance of a point (2) of the base's x-y plane."""
ROW = 12
"""Numbers of a rule."""


class Space(NamedTuple):
    """What a posture is checked against; see `golem.capabilities.planning.joint_space`.

    Attributes:
        ints, floats: the robot, see `sphere_kernel`.
        world: what stands around, see `world_kernel`.
        lower, upper: (n,) range of the joints [rad].
        rules: (k, 12).
        masses: (n + 1, 4) centre of mass of each body in its frame [m], and its share of the robot's mass.
        margins: (2,) distance kept from itself and from the world [m].
    """

    ints: Ints
    floats: Array
    world: WorldTables
    lower: Array
    upper: Array
    rules: Array
    masses: Array
    margins: Array


@njit(cache=True, nogil=True, error_model="numpy")
def _broken_rule(space: Space, R: Array, p: Array) -> int:
    """Return the first rule that the bodies break, or -1."""
    rules, masses = space.rules, space.masses
    for i in range(len(rules)):
        kind, b = rules[i, 0], int(rules[i, 1])
        if kind == BALANCED:
            square = 0.0
            for k in range(2):
                off = 0.0
                for j in range(len(masses)):
                    off += masses[j, 3] * (
                        R[j, 3 * k] * masses[j, 0]
                        + R[j, 3 * k + 1] * masses[j, 1]
                        + R[j, 3 * k + 2] * masses[j, 2]
                        + p[j, k]
                    )
                off -= rules[i, 2 + k]
                square += off * off
            if square > rules[i, 4] * rules[i, 4]:
                return i
            continue
        along = 0.0
        for k in range(3):
            v = R[b, 3 * k] * rules[i, 2] + R[b, 3 * k + 1] * rules[i, 3] + R[b, 3 * k + 2] * rules[i, 4]
            if kind == IN_BOX:
                v += p[b, k]
                if v < rules[i, 5 + k] or v > rules[i, 8 + k]:
                    return i
            along += v * rules[i, 5 + k]
        if kind == ALONG_AXIS and along < rules[i, 8]:
            return i
    return -1


@njit(cache=True, nogil=True, error_model="numpy")
def verdict(q: Array, space: Space) -> int:
    """Return `FREE`, or why the posture `q` (n,) is not, the cheapest reason first."""
    n = len(q)
    for j in range(n):
        # NaN fails every comparison.
        if not (space.lower[j] <= q[j] <= space.upper[j]):
            return RANGE
    R, p = np.empty((n + 1, 9)), np.empty((n + 1, 3))
    place(q, space.ints, space.floats, R, p)
    rule = _broken_rule(space, R, p)
    if rule >= 0:
        return RULE + rule
    if bodies_collide(R, p, space.ints, space.floats, space.margins[0]):
        return ITSELF
    solid = len(space.world.shapes) + len(space.world.balls) > 0
    if solid and bodies_hit_world(R, p, space.ints, space.floats, space.world, space.margins[1]):
        return WORLD
    return FREE


@njit(cache=True, nogil=True, error_model="numpy")
def verdicts(Q: Array, space: Space, out: Indices) -> None:
    """Write into `out` (m,) the verdict on each row of `Q` (m, n)."""
    for i in range(len(Q)):
        out[i] = verdict(Q[i], space)


@njit(cache=True, nogil=True, error_model="numpy")
def _farthest(a: Array, b: Array) -> float:
    """Return the largest distance of `a` (n,) from `b` in a joint."""
    most = 0.0
    for j in range(len(a)):
        most = max(most, abs(b[j] - a[j]))
    return most


@njit(cache=True, nogil=True, error_model="numpy")
def _between(a: Array, b: Array, share: float, out: Array) -> None:
    """Write into `out` (n,) what is `share` of the way from `a` to `b`; `out` may be `b`."""
    for j in range(len(a)):
        out[j] = a[j] + (b[j] - a[j]) * share


@njit(cache=True, nogil=True, error_model="numpy")
def free_steps(a: Array, b: Array, step: float, space: Space) -> tuple[int, int]:
    """Return how many steps from `a` to `b` are free, and of how many; none is longer than `step` in a joint.

    The steps are equal, and `a` is not looked at.
    """
    parts = max(1, int(math.ceil(_farthest(a, b) / step)))
    q = np.empty(len(a))
    for i in range(1, parts + 1):
        _between(a, b, i / parts, q)
        if verdict(q, space) != FREE:
            return i - 1, parts
    return parts, parts


@njit(cache=True, nogil=True, error_model="numpy")
def _nearest(q: Array, nodes: Array, count: int, weight: Array) -> int:
    best, found = np.inf, 0
    for i in range(count):
        d = 0.0
        for j in range(len(q)):
            e = weight[j] * (nodes[i, j] - q[j])
            d += e * e
        if d < best:
            best, found = d, i
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _extend(
    q: Array, nodes: Array, parents: Indices, size: Indices, side: int, reach: float, step: float,
    weight: Array, space: Space, checks: Indices,
) -> int:  # fmt: skip
    """Grow tree `side` towards `q` by `reach` at most; return 0 if trapped, 1 if advanced, 2 if it got there."""
    near = _nearest(q, nodes[side], int(size[side]), weight)
    start = nodes[side, near]
    far, goal = _farthest(q, start), q.copy()
    if far > reach:
        _between(start, q, reach / far, goal)
    free, parts = free_steps(start, goal, step, space)
    checks[0] += min(free + 1, parts)
    if free == 0 or size[side] == nodes.shape[1]:
        return 0
    at = size[side]
    _between(start, goal, free / parts, nodes[side, at])
    parents[side, at] = near
    size[side] += 1
    return 2 if free == parts and far <= reach else 1


@njit(cache=True, nogil=True, error_model="numpy")
def grow(
    samples: Array,
    nodes: Array,
    parents: Indices,
    size: Indices,
    reach: float,
    step: float,
    weight: Array,
    space: Space,
    checks: Indices,
) -> bool:
    """Grow two trees towards each other (RRT-Connect, Kuffner and LaValle, 2000); return whether they met.

    They met in the last node of either tree. Tree 0 grows from the start, tree 1 from the goals; they take turns.

    Args:
        samples: (k, n) where to grow to.
        nodes: (2, m, n) both trees.
        parents: (2, m) of each node; -1 for a root.
        size: (2,) nodes of each tree so far.
        reach: longest edge [rad in a joint].
        step: longest step between two checks [rad in a joint].
        weight: (n,) of each joint in the distance that finds the nearest node.
        checks: (1,) counts postures checked.
    """
    for i in range(len(samples)):
        one = i % 2
        if _extend(samples[i], nodes, parents, size, one, reach, step, weight, space, checks) == 0:
            continue
        target = nodes[one, size[one] - 1].copy()
        while True:
            grown = _extend(target, nodes, parents, size, 1 - one, reach, step, weight, space, checks)
            if grown == 2:
                return True
            if grown == 0:
                break
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def points_of(Q: Array, bodies: Indices, offsets: Array, space: Space, out: Array) -> None:
    """Write into `out` (m, k, 3) where points at `offsets` (k, 3) of `bodies` (k,) are at each row of `Q` (m, n)."""
    n = Q.shape[1]
    R, p = np.empty((n + 1, 9)), np.empty((n + 1, 3))
    for i in range(len(Q)):
        place(Q[i], space.ints, space.floats, R, p)
        for j in range(len(bodies)):
            b = bodies[j]
            for k in range(3):
                out[i, j, k] = (
                    R[b, 3 * k] * offsets[j, 0]
                    + R[b, 3 * k + 1] * offsets[j, 1]
                    + R[b, 3 * k + 2] * offsets[j, 2]
                    + p[b, k]
                )


@njit(cache=True, nogil=True, error_model="numpy")
def speeds_along(cap: Array, lengths: Array, tangents: Array, accel: Array) -> Array:
    """Return (m,) the fastest speed along a path at each of its points, at rest at both ends.

    Args:
        cap: (m,) bound of the speed at each point.
        lengths: (m - 1,) of the parts between them.
        tangents: (m - 1, n) joints per length in each part.
        accel: (n,) bound of each joint's acceleration along the path [rad/s^2].
    """
    m = len(cap)
    v = cap.copy()
    v[0] = v[m - 1] = 0.0
    pull = np.empty(m - 1)
    for i in range(m - 1):
        most = np.inf
        for j in range(len(accel)):
            t = abs(tangents[i, j])
            if t > 1e-12:
                most = min(most, accel[j] / t)
        pull[i] = most
    for i in range(m - 1):
        v[i + 1] = min(v[i + 1], math.sqrt(v[i] ** 2 + 2.0 * pull[i] * lengths[i]))
    for k in range(m - 1):
        i = m - 2 - k
        v[i] = min(v[i], math.sqrt(v[i + 1] ** 2 + 2.0 * pull[i] * lengths[i]))
    return v
