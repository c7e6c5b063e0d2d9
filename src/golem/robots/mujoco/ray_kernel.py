"""Compiled ray casting against MuJoCo's primitive shapes; compiled once, then cached on disk.

A LiDAR casts some hundred rays from one place within a few degrees of azimuth: shapes outside of that wedge are left
out for all of them at once, which `mujoco.mj_multiRay` cannot know. Distances are those of `mujoco.mj_ray`.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.kernels import njit
from golem.types import Array

_kinds = mujoco.mjtGeom
PLANE, SPHERE, CAPSULE = int(_kinds.mjGEOM_PLANE), int(_kinds.mjGEOM_SPHERE), int(_kinds.mjGEOM_CAPSULE)
CYLINDER, BOX = int(_kinds.mjGEOM_CYLINDER), int(_kinds.mjGEOM_BOX)
KNOWN = (PLANE, SPHERE, CAPSULE, CYLINDER, BOX)
"""Kinds of shapes that rays are cast against here."""
NONE = -1.0
"""Distance of a ray that hits nothing."""
_TINY = 1e-15


@njit(cache=True, nogil=True, error_model="numpy")
def cast(
    origin: Array,
    R: Array,
    wedge: Array,
    rays: Array,
    shapes: NDArray[np.int64],
    kinds: NDArray[np.int64],
    sizes: Array,
    bounds: Array,
    places: Array,
    frames: Array,
    distance: Array,
) -> None:
    """Write the distance along each ray to the first shape into `distance`; `NONE` where there is none.

    Args:
        origin: (3,) of all rays in the world [m].
        R: (3, 3) axes of the sensor in the world.
        wedge: (2,) middle and half width of the azimuths of all rays in the sensor's frame [rad].
        rays: (n, 3) unit directions in the world.
        shapes: (m,) indices of the shapes into the arrays below.
        kinds: of each shape, as in `mujoco.MjModel`.
        sizes: (., 3) likewise [m].
        bounds: radius of its bounding sphere [m], 0 for a plane.
        places: (., 3) of its middle in the world [m], as in `mujoco.MjData`.
        frames: (., 9) its axes in the world.
        distance: (n,) written [m].
    """
    for i in range(len(rays)):
        distance[i] = np.inf
    o, d = np.zeros(3), np.zeros(3)
    for s in range(len(shapes)):
        g = shapes[s]
        cx, cy, cz = places[g, 0] - origin[0], places[g, 1] - origin[1], places[g, 2] - origin[2]
        r = bounds[g]
        if r > 0.0:
            x = R[0, 0] * cx + R[1, 0] * cy + R[2, 0] * cz
            y = R[0, 1] * cx + R[1, 1] * cy + R[2, 1] * cz
            flat = math.hypot(x, y)
            if flat > r:
                off = abs(math.atan2(y, x) - wedge[0])
                off = min(off, 2.0 * math.pi - off)
                if off > wedge[1] + math.asin(r / flat):
                    continue
        square, kind, f = cx * cx + cy * cy + cz * cz - r * r, kinds[g], frames[g]
        for k in range(3):
            o[k] = -(f[k] * cx + f[3 + k] * cy + f[6 + k] * cz)
        for i in range(len(rays)):
            vx, vy, vz = rays[i, 0], rays[i, 1], rays[i, 2]
            if r > 0.0:
                along = vx * cx + vy * cy + vz * cz
                # Outside of the bounding sphere, behind it, or further than what was hit.
                if square > 0.0 and (along < 0.0 or along * along < square or along - r > distance[i]):
                    continue
            for k in range(3):
                d[k] = f[k] * vx + f[3 + k] * vy + f[6 + k] * vz
            if kind == BOX:
                t = _box(o, d, sizes[g])
            elif kind == PLANE:
                t = _plane(o, d, sizes[g])
            elif kind == SPHERE:
                t = _ball(o, d, 0.0, sizes[g, 0])
            else:
                t = _round(o, d, sizes[g], kind == CAPSULE)
            if 0.0 <= t < distance[i]:
                distance[i] = t
    for i in range(len(rays)):
        if distance[i] == np.inf:
            distance[i] = NONE


@njit(cache=True, nogil=True, error_model="numpy")
def shaken(rays: Array, noise: Array, deviation: float) -> Array:
    """Return unit directions (n, 3) off by `noise` (n, 3), standard normal, of `deviation` [rad]."""
    out = np.empty(rays.shape)
    for i in range(len(rays)):
        x, y, z = rays[i, 0], rays[i, 1], rays[i, 2]
        a, b, c = noise[i, 0], noise[i, 1], noise[i, 2]
        u = x + deviation * (y * c - z * b)
        v = y + deviation * (z * a - x * c)
        w = z + deviation * (x * b - y * a)
        length = math.sqrt(u * u + v * v + w * w)
        out[i, 0], out[i, 1], out[i, 2] = u / length, v / length, w / length
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def carried(rays: Array, rate: Array, dt: Array, R: Array) -> Array:
    """Return directions (n, 3) in the world of a sensor that turns.

    Args:
        rays: (n, 3) in the sensor's frame.
        rate: (3,) its angular rate in its own axes [rad/s].
        dt: (n,) time of each ray after the sensor was at `R` [s].
        R: (3, 3) axes of the sensor in the world.
    """
    out = np.empty(rays.shape)
    for i in range(len(rays)):
        x, y, z = rays[i, 0], rays[i, 1], rays[i, 2]
        u = x + (rate[1] * z - rate[2] * y) * dt[i]
        v = y + (rate[2] * x - rate[0] * z) * dt[i]
        w = z + (rate[0] * y - rate[1] * x) * dt[i]
        for a in range(3):
            out[i, a] = R[a, 0] * u + R[a, 1] * v + R[a, 2] * w
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _plane(o: Array, d: Array, size: Array) -> float:
    if d[2] > -_TINY:
        return NONE
    t = -o[2] / d[2]
    for k in range(2):
        if size[k] > 0.0 and abs(o[k] + t * d[k]) > size[k]:
            return NONE
    return t


@njit(cache=True, nogil=True, error_model="numpy")
def _box(o: Array, d: Array, size: Array) -> float:
    enter, leave = -np.inf, np.inf
    for k in range(3):
        if abs(d[k]) < _TINY:
            if abs(o[k]) > size[k]:
                return NONE
            continue
        one, other = (-size[k] - o[k]) / d[k], (size[k] - o[k]) / d[k]
        enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
    if leave < max(enter, 0.0):
        return NONE
    return enter if enter >= 0.0 else leave


@njit(cache=True, nogil=True, error_model="numpy")
def _ball(o: Array, d: Array, z: float, radius: float) -> float:
    """Return the distance to a ball whose middle is `z` above that of the shape."""
    b = o[0] * d[0] + o[1] * d[1] + (o[2] - z) * d[2]
    c = o[0] * o[0] + o[1] * o[1] + (o[2] - z) * (o[2] - z) - radius * radius
    root = b * b - c
    if root < _TINY:
        return NONE
    root = math.sqrt(root)
    return -b - root if -b - root >= 0.0 else -b + root


@njit(cache=True, nogil=True, error_model="numpy")
def _round(o: Array, d: Array, size: Array, capsule: bool) -> float:
    """Return the distance to a cylinder about z of radius `size[0]` and half length `size[1]`, or to a capsule."""
    radius, half, best = size[0], size[1], np.inf
    a = d[0] * d[0] + d[1] * d[1]
    b, c = o[0] * d[0] + o[1] * d[1], o[0] * o[0] + o[1] * o[1] - radius * radius
    root = b * b - a * c
    if a > _TINY and root > 0.0:
        root = math.sqrt(root)
        for sign in range(-1, 2, 2):
            t = (-b + sign * root) / a
            if 0.0 <= t < best and abs(o[2] + t * d[2]) <= half:
                best = t
    for side in range(-1, 2, 2):
        end = side * half
        if capsule:
            # The half of the ball beyond the end; both of its crossings may be on it.
            b = o[0] * d[0] + o[1] * d[1] + (o[2] - end) * d[2]
            c = o[0] * o[0] + o[1] * o[1] + (o[2] - end) * (o[2] - end) - radius * radius
            root = b * b - c
            if root > 0.0:
                root = math.sqrt(root)
                for sign in range(-1, 2, 2):
                    t = -b + sign * root
                    beyond = (o[2] + t * d[2] - end) * end
                    if 0.0 <= t < best and beyond >= 0.0:
                        best = t
        elif abs(d[2]) > _TINY:
            t = (end - o[2]) / d[2]
            if 0.0 <= t < best and (o[0] + t * d[0]) ** 2 + (o[1] + t * d[1]) ** 2 <= radius * radius:
                best = t
    return best if best < np.inf else NONE
