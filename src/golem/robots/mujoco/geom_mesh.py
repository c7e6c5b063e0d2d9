"""The surfaces of a model's shapes as triangle meshes, and where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np

from golem.robots.model.spatial import transform
from golem.types import Array

if TYPE_CHECKING:
    import trimesh

_NAMES = {
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
}


def geom_mesh(model: mujoco.MjModel, geom: int) -> trimesh.Trimesh:
    """Return the surface of a geom in its own frame [m]. Raises NotImplementedError: no world has such a kind."""
    import trimesh  # 40 MB, which a robot that only runs does without

    kind = mujoco.mjtGeom(int(model.geom_type[geom]))
    x, y, z = (float(v) for v in model.geom_size[geom])
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        start, number = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        vertices = model.mesh_vert[first : first + count].astype(float)
        return trimesh.Trimesh(vertices, model.mesh_face[start : start + number].copy())
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
        return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]])
    if kind not in _NAMES:
        raise NotImplementedError(f"geom {geom} is a {kind.name}")
    return primitive(_NAMES[kind], x, y, z)


def primitive(name: str, x: float, y: float, z: float) -> trimesh.Trimesh:
    """Return the surface of a shape about its middle [m].

    Args:
        name: box, sphere, ellipsoid, cylinder or capsule.
        x: half side, or radius.
        y: half side, or half length along z.
        z: half side.
    """
    import trimesh

    if name == "box":
        return trimesh.creation.box(extents=(2 * x, 2 * y, 2 * z))
    if name == "sphere":
        return trimesh.creation.icosphere(subdivisions=3, radius=x)
    if name == "ellipsoid":
        sphere = trimesh.creation.icosphere(subdivisions=3)
        return trimesh.Trimesh(sphere.vertices * (x, y, z), sphere.faces)
    if name == "cylinder":
        return trimesh.creation.cylinder(radius=x, height=2 * y, sections=24)
    return trimesh.creation.capsule(radius=x, height=2 * y, count=(24, 12))


def pose_matrix(position: Array, quaternion: Array) -> Array:
    """Return the (4, 4) pose with `position` (3,) and `quaternion` (4,) wxyz."""
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, quaternion)
    return transform(position, rotation.reshape(3, 3))
