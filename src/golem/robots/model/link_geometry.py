"""The links of any URDF or MJCF file as triangle meshes on a tree of hinges and slides."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.errors import ConfigError, unknown_name
from golem.robots.model import mjcf
from golem.robots.model.geom_mesh import geom_mesh, pose_matrix
from golem.types import Array

GeometryChoice = Literal["visual", "collision"]
GEOMETRY_CHOICES: tuple[GeometryChoice, ...] = ("visual", "collision")
"""Which surfaces of a link count: what is seen, or what touches. A link without the chosen ones gives the others."""
JointKind = Literal["fixed", "hinge", "slide"]
_KINDS: dict[int, JointKind] = {
    int(mujoco.mjtJoint.mjJNT_HINGE): "hinge",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "slide",
}
_UNBOUNDED = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF)
_WORLD = "world"


@dataclass(frozen=True, slots=True)
class SurfacePart:
    """A triangle mesh in the frame of its link: vertices (n, 3) [m], faces (m, 3)."""

    vertices: Array
    faces: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class LinkGeometry:
    """A link.

    Attributes:
        name: of the link.
        parent: index of its parent in `RobotGeometry.links`, -1 for a root.
        T_parent_link: (4, 4) pose in the parent at zero angle; for a root, in the base.
        joint: name of the joint that moves it in its parent; empty when fixed.
        kind: of that joint.
        axis: (3,) unit vector of the joint in the link.
        anchor: (3,) point on a hinge's axis in the link [m].
        lower, upper: range [rad or m]; +-pi or +-1 m where the file gives none.
        parts: its surface.
    """

    name: str
    parent: int
    T_parent_link: Array
    joint: str
    kind: JointKind
    axis: Array
    anchor: Array
    lower: float
    upper: float
    parts: tuple[SurfacePart, ...]


@dataclass(frozen=True, slots=True)
class RobotGeometry:
    """The links of a robot, parents before children.

    The base is the root link, or the world's frame where a fixed robot has several roots.
    """

    name: str
    links: tuple[LinkGeometry, ...]


def read_geometry(file: Path, choice: GeometryChoice = "visual") -> RobotGeometry:
    """Read a URDF or MJCF file.

    Args:
        file: the file; meshes are STL or OBJ, beside it or where it says.
        choice: which surfaces.

    Raises:
        ConfigError: the file cannot be read, has a joint that is no hinge or slide, or no surface at all.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(file))
        spec.compiler.discardvisual = False
        spec.compiler.fusestatic = False
        model = spec.compile()
    except (ValueError, OSError, mujoco.FatalError) as error:
        raise ConfigError(f"Cannot read '{file}' as URDF or MJCF: {' '.join(str(error).split())}") from error
    return geometry_of(model, file.stem, choice)


def h12_geometry() -> RobotGeometry:
    """Return the H1-2 with MAGPIE hands as GOLEM builds it; its surfaces are those of `looks`."""
    return geometry_of(mjcf.robot_spec(hands=True).compile(), "golem_h12", "visual")


def geometry_of(model: mujoco.MjModel, name: str, choice: GeometryChoice) -> RobotGeometry:
    """Return the links of a compiled model.

    Raises:
        ConfigError: see `read_geometry`.
    """
    if choice not in GEOMETRY_CHOICES:
        raise unknown_name("choice of surfaces", choice, GEOMETRY_CHOICES)
    roots = [b for b in range(1, model.nbody) if model.body_parentid[b] == 0]
    lone = roots[0] if len(roots) == 1 else None
    links: list[LinkGeometry] = []
    last: dict[int, int] = {0: -1}
    fixed_parts = _parts(model, 0, choice)
    if fixed_parts:
        last[0] = 0
        links.append(_link(_WORLD, -1, np.eye(4), fixed_parts))
        lone = None
    for body in range(1, model.nbody):
        parent = last[int(model.body_parentid[body])]
        T = pose_matrix(model.body_pos[body], model.body_quat[body]) if body != lone else np.eye(4)
        parts = _parts(model, body, choice)
        own = model.body(body).name or f"link_{body}"
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        moving = [j for j in range(first, first + count) if model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE]
        if not moving:
            links.append(_link(own, parent, T, parts))
        for j in moving:
            outermost = j == moving[-1]
            links.append(
                _moved(model, j, own if outermost else f"{own}:{j}", parent, T, parts if outermost else ())
            )
            parent, T = len(links) - 1, np.eye(4)
        last[body] = len(links) - 1
    if not any(link.parts for link in links):
        raise ConfigError(
            f"'{name}' has no geometry: none of its links has a mesh or a shape to cover with spheres."
        )
    return RobotGeometry(name, tuple(links))


def _link(name: str, parent: int, T: Array, parts: tuple[SurfacePart, ...]) -> LinkGeometry:
    return LinkGeometry(name, parent, T, "", "fixed", np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0, 0.0, parts)


def _moved(
    model: mujoco.MjModel, joint: int, name: str, parent: int, T: Array, parts: tuple[SurfacePart, ...]
) -> LinkGeometry:
    title = model.joint(joint).name or f"joint_{joint}"
    kind = _KINDS.get(int(model.jnt_type[joint]))
    if kind is None:
        raise ConfigError(f"Joint '{title}' is a ball joint; links hang on hinges, slides, or a free root.")
    lower, upper = (float(x) for x in model.jnt_range[joint])
    if not model.jnt_limited[joint]:
        upper = float(np.pi) if kind == "hinge" else 1.0
        lower = -upper
    axis, anchor = model.jnt_axis[joint].copy(), model.jnt_pos[joint].copy()
    return LinkGeometry(name, parent, T, title, kind, axis, anchor, lower, upper, parts)


def _parts(model: mujoco.MjModel, body: int, choice: GeometryChoice) -> tuple[SurfacePart, ...]:
    paired = set(model.pair_geom1.tolist()) | set(model.pair_geom2.tolist())
    seen: list[int] = []
    touching: list[int] = []
    first = int(model.body_geomadr[body])
    for geom in range(first, first + int(model.body_geomnum[body])):
        if mujoco.mjtGeom(int(model.geom_type[geom])) in _UNBOUNDED:
            continue
        touches = model.geom_contype[geom] or model.geom_conaffinity[geom] or geom in paired
        (touching if touches else seen).append(geom)
    chosen, others = (seen, touching) if choice == "visual" else (touching, seen)
    parts: list[SurfacePart] = []
    for geom in chosen or others:
        mesh = geom_mesh(model, geom).apply_transform(
            pose_matrix(model.geom_pos[geom], model.geom_quat[geom])
        )
        parts.append(SurfacePart(np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)))
    return tuple(parts)
