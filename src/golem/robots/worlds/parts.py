"""Small builders the worlds share: meshes of revolution, hexagons, plates with a hole, visual and collision geoms."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.types import Array

Faces = NDArray[np.int64]
"""(m, 3) vertex indices of triangles."""
WORLD_CONTACT = 1
"""contype and conaffinity of everything that collides in a world; a robot geom that shall touch it needs bit 0."""
VISUAL_GROUP = 2
COLLISION_GROUP = 3
"""MuJoCo renders groups 0 to 2 by default, so collision shapes stay invisible."""
BOX, SPHERE = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_SPHERE
CYLINDER, CAPSULE = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE
ALONG_X, ALONG_Y = (0.70710678, 0.0, 0.70710678, 0.0), (0.70710678, 0.70710678, 0.0, 0.0)
"""Turns, wxyz, of a cylinder that lies along x, and of one along y."""


def visual(
    body: mujoco.MjsBody,
    kind: mujoco.mjtGeom,
    size: Sequence[float],
    pos: Sequence[float] = (0.0, 0.0, 0.0),
    material: str = "",
    *,
    name: str = "",
    quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
    rgba: Sequence[float] | None = None,
) -> mujoco.MjsGeom:
    """Add a massless geom that is only seen. `size` as in MJCF [m], pose in the body frame, quat wxyz."""
    geom = body.add_geom(
        name=name, type=kind, size=_pad3(size), pos=list(pos), quat=list(quat), material=material,
        contype=0, conaffinity=0, group=VISUAL_GROUP, mass=0.0,
    )  # fmt: skip
    if rgba is not None:
        geom.rgba = list(rgba)
    return geom


def visual_mesh(
    body: mujoco.MjsBody, mesh: str, pos: Sequence[float] = (0.0, 0.0, 0.0), *, material: str, name: str
) -> mujoco.MjsGeom:
    """Add a mesh that is only seen."""
    return body.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh, pos=list(pos), material=material,
        contype=0, conaffinity=0, group=VISUAL_GROUP, mass=0.0,
    )  # fmt: skip


def collider(
    body: mujoco.MjsBody,
    kind: mujoco.mjtGeom,
    size: Sequence[float],
    pos: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    name: str = "",
    quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
    friction: float = 0.6,
    mass: float = 0.0,
    solref: tuple[float, float] | None = None,
) -> mujoco.MjsGeom:
    """Add an invisible geom that collides, with sliding friction coefficient `friction` and no contact margin."""
    geom = body.add_geom(
        name=name, type=kind, size=_pad3(size), pos=list(pos), quat=list(quat), rgba=[0.5, 0.5, 0.5, 1.0],
        contype=WORLD_CONTACT, conaffinity=WORLD_CONTACT, group=COLLISION_GROUP, mass=mass,
        friction=[friction, 0.003, 0.0001], margin=0.0,
    )  # fmt: skip
    if solref is not None:
        geom.solref = list(solref)
    return geom


def solid(
    body: mujoco.MjsBody,
    kind: mujoco.mjtGeom,
    size: Sequence[float],
    pos: Sequence[float],
    material: str,
    *,
    friction: float = 0.6,
    mass: float = 0.0,
) -> None:
    """Add a geom that collides, and one like it that is seen."""
    collider(body, kind, size, pos, friction=friction, mass=mass)
    visual(body, kind, size, pos, material)


def add_mesh(spec: mujoco.MjSpec, name: str, vertices: Array, faces: Faces) -> str:
    """Add a visual mesh from (n, 3) vertices [m] and (m, 3) triangles; flat shaded. Returns `name`."""
    flat = vertices[faces.ravel()]  # unshared vertices, so that edges stay sharp
    shell, corners = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL, list(range(len(flat)))
    spec.add_mesh(name=name, uservert=flat.ravel().tolist(), userface=corners, inertia=shell)
    return name


def lathe(profile: Sequence[tuple[float, float]], sides: int = 20) -> tuple[Array, Faces]:
    """Revolve (radius, height) points, given from bottom to top, about z; the ends are closed where radius > 0.

    A profile that ends where it began makes a ring.

    Returns:
        vertices (n, 3) [m] and triangles (m, 3), outward facing.
    """
    points, round_again = np.asarray(profile, dtype=float), profile[0] == profile[-1]
    if not round_again and points[0, 0] > 0:
        points = np.vstack([[0.0, points[0, 1]], points])
    if not round_again and points[-1, 0] > 0:
        points = np.vstack([points, [0.0, points[-1, 1]]])
    angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = np.concatenate([np.column_stack([r * ring, np.full(sides, z)]) for r, z in points])
    faces = []
    for row in range(len(points) - 1):
        for i in range(sides):
            j = (i + 1) % sides
            a, b, c, d = row * sides + i, row * sides + j, (row + 1) * sides + j, (row + 1) * sides + i
            if points[row, 0] > 0:
                faces.append((a, b, c))
            if points[row + 1, 0] > 0:
                faces.append((a, c, d))
    return vertices, np.asarray(faces, np.int64)


def holed_plate(half: float, hole_radius: float, depth: float, sides: int = 24) -> tuple[Array, Faces]:
    """Return a square plate face (z = 0) with a round hole and the hole's wall and dark bottom at -`depth`.

    Args:
        half: half side of the square [m].
        hole_radius: radius of the hole [m], less than `half`.
        depth: depth of the hole [m].
        sides: corners of the hole's outline, a multiple of 4.
    """
    angle = (np.arange(sides) + 0.5) * 2 * np.pi / sides
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inner = direction * hole_radius
    outer = direction * (half / np.abs(direction).max(axis=1, keepdims=True))
    z0, z1 = np.zeros(sides), np.full(sides, -depth)
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half
    rings = [(outer, z0), (inner, z0), (inner, z1), (corners, np.zeros(4))]
    vertices = np.concatenate([*(np.column_stack(ring) for ring in rings), [[0.0, 0.0, -depth]]])
    faces: list[tuple[int, int, int]] = []
    for i in range(sides):
        j = (i + 1) % sides
        faces += [(i, j, sides + j), (i, sides + j, sides + i)]
        faces += [(sides + i, sides + j, 2 * sides + j), (sides + i, 2 * sides + j, 2 * sides + i)]
        faces.append((2 * sides + i, 2 * sides + j, 3 * sides + 4))
    for quadrant in range(4):
        i = sides // 8 + quadrant * sides // 4 - 1
        faces.append((i, 3 * sides + quadrant, i + 1))
    return vertices, np.asarray(faces, np.int64)


def hexagon(across_flats: float, height: float, chamfer: float = 0.0006) -> tuple[Array, Faces]:
    """Return a hexagonal prism on z = 0 with a chamfered top. Lengths in metres."""
    radius = across_flats / np.sqrt(3.0)
    return lathe([(radius, 0.0), (radius, height - chamfer), (radius - chamfer * 1.5, height)], sides=6)


def _pad3(size: Sequence[float]) -> list[float]:
    return [*size, 0.0, 0.0][:3]
