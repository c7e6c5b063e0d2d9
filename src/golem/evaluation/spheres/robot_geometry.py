"""The links of any URDF or MJCF file as triangle meshes on a tree of hinges and slides."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np

from golem.errors import ConfigError, check_known
from golem.robots.model import mjcf
from golem.robots.model.link_geometry import JointKind, LinkGeometry, SurfacePart, joint_pose
from golem.robots.mujoco.geom_mesh import geom_mesh, pose_matrix
from golem.types import Array

GeometryChoice = Literal["visual", "collision"]
GEOMETRY_CHOICES: tuple[GeometryChoice, ...] = ("visual", "collision")
"""Which surfaces of a link count: what is seen, or what touches. A link without the chosen ones gives the others."""
_KINDS: dict[int, JointKind] = {int(mujoco.mjtJoint.mjJNT_HINGE): "hinge", int(mujoco.mjtJoint.mjJNT_SLIDE): "slide"}
_UNBOUNDED = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF)
_WORLD = "world"
_PREFIX = re.compile(rb"(</?|\s)([A-Za-z_][\w.-]*):(?=[A-Za-z_][\w.-]*[\s=/>])")


@dataclass(frozen=True, slots=True)
class RobotGeometry:
    """The links of a robot, parents before children.

    The base is the root link, or the world's frame where a fixed robot has several roots.
    """

    name: str
    links: tuple[LinkGeometry, ...]


def read_geometry(
    file: Path, choice: GeometryChoice = "visual", packages: Mapping[str, Path] | None = None
) -> RobotGeometry:
    """Read a URDF or MJCF file.

    Args:
        packages: folders of ROS packages by name; others are looked for, see `mesh_file.find_mesh`.

    Raises:
        ConfigError: the file cannot be read, has a joint that is no hinge or slide, or no surface at all; of a URDF all
            that is wrong is named.
    """
    from golem.evaluation.spheres.urdf_geometry import read_urdf

    check_known("choice of surfaces", GEOMETRY_CHOICES, choice)
    try:
        text = file.read_bytes()
        try:
            root = ET.fromstring(text)
        except ET.ParseError:  # names of a space that the file does not declare, which readers of URDF let pass
            root = ET.fromstring(_PREFIX.sub(rb"\1\2_", text))
    except (OSError, ET.ParseError, ValueError, LookupError) as error:
        why = getattr(error, "strerror", None) or f"it is no XML ({error})"
        raise ConfigError(f"Cannot read '{file}' as URDF or MJCF: {why}.") from error
    if root.tag == "robot":
        return read_urdf(root, file, choice, packages or {})
    if root.tag != "mujoco":
        raise ConfigError(f"Cannot read '{file}' as URDF or MJCF: its root is <{root.tag}>.")
    try:
        spec = mujoco.MjSpec.from_file(str(file))
        spec.compiler.discardvisual = False
        spec.compiler.fusestatic = False
        # Spheres need no inertia and no looks: what those would have refused, plates or a lost picture, is let through.
        for element in (*spec.geoms, *spec.sites, *spec.tendons):
            element.material = ""
        for element in (*spec.skins, *spec.materials, *spec.textures):
            spec.delete(element)
        spec.compiler.balanceinertia = True
        spec.compiler.boundmass = spec.compiler.boundinertia = 1e-6
        for mesh in spec.meshes:
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        model = spec.compile()
    except (ValueError, OSError, mujoco.FatalError) as error:
        raise ConfigError(f"Cannot read '{file}' as URDF or MJCF: {' '.join(str(error).split())}") from error
    return geometry_of(model, file.stem, choice)


def h12_geometry() -> RobotGeometry:
    """Return the H1-2 with MAGPIE hands as GOLEM builds it; its surfaces are those of `looks`."""
    return geometry_of(mjcf.robot_spec(hands=True).compile(), "golem_h12", "visual")


def geometry_of(model: mujoco.MjModel, name: str, choice: GeometryChoice) -> RobotGeometry:
    """Return the links of a compiled model. Raises ConfigError: see `read_geometry`."""
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
            links.append(_moved(model, j, own if outermost else f"{own}:{j}", parent, T, parts if outermost else ()))
            parent, T = len(links) - 1, np.eye(4)
        last[body] = len(links) - 1
    links, wrong = led(links)
    if wrong:
        raise ConfigError(f"'{name}' cannot be read as a robot: {'; '.join(wrong)}.")
    return with_surface(RobotGeometry(name, tuple(links)))


def led(links: Sequence[LinkGeometry]) -> tuple[list[LinkGeometry], list[str]]:
    """Return the links, each joint that follows another led by a free one, and what is wrong with the leaders."""
    by_joint = {link.joint: link for link in links if link.joint}
    found: list[LinkGeometry] = []
    wrong: list[str] = []
    for link in links:
        own, seen = link, {link.joint}
        while own.leader:
            above = by_joint.get(own.leader)
            if above is None or above.joint in seen:
                wrong.append(f"joint '{link.joint}' follows '{own.leader}', which is no joint that moves by itself")
                break
            if not above.leader:
                break
            seen.add(above.joint)
            ratio, offset = own.ratio * above.ratio, own.ratio * above.offset + own.offset
            own = replace(own, leader=above.leader, ratio=ratio, offset=offset)
        found.append(own)
    return found, wrong


def with_surface(robot: RobotGeometry) -> RobotGeometry:
    """Return the robot. Raises ConfigError: none of its links has a surface."""
    if not any(link.parts for link in robot.links):
        raise ConfigError(
            f"'{robot.name}' has no geometry: none of its links has a mesh or a shape to cover with spheres."
        )
    return robot


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
    link = LinkGeometry(name, parent, T, title, kind, axis, anchor, lower, upper, parts, *_leader(model, joint))
    # The file's pose is that at the joint's `ref`.
    return replace(link, T_parent_link=joint_pose(link, -float(model.qpos0[model.jnt_qposadr[joint]])))


def _leader(model: mujoco.MjModel, joint: int) -> tuple[str, float, float]:
    """Return the joint that `joint` follows, ratio and offset; see `LinkGeometry`. Raises ConfigError: no line."""
    for k in range(model.neq):
        if model.eq_type[k] != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[k] or model.eq_obj1id[k] != joint:
            continue
        other, line = int(model.eq_obj2id[k]), model.eq_data[k, :5]
        if other < 0 or line[2:].any():
            raise ConfigError(f"Joint '{model.joint(joint).name}' follows no other by a straight line.")
        own, lead = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (joint, other))
        # MuJoCo's line is between the ways from `ref`.
        return (model.joint(other).name or f"joint_{other}", float(line[1]), float(own + line[0] - line[1] * lead))
    return "", 1.0, 0.0


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
        mesh = geom_mesh(model, geom).apply_transform(pose_matrix(model.geom_pos[geom], model.geom_quat[geom]))
        parts.append(SurfacePart(np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)))
    return tuple(parts)
