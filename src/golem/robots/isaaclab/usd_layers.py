"""What a compiled MuJoCo model is in USD: the robot as an articulation, the world as static shapes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from golem.errors import ConfigError
from golem.robots.model.spatial import quat_to_axis
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco import other_engine
from golem.robots.mujoco.other_engine import CONTACT_OFFSET, FINGER_DRIVE, follower_names, touchable
from golem.types import Array

HEADER = """#usda 1.0
(
    defaultPrim = "{root}"
    kilogramsPerUnit = 1
    metersPerUnit = 1
    upAxis = "Z"
)

"""
"""What begins a layer: SI units, z up."""


@dataclass
class Prim:
    """One prim of a layer.

    Attributes:
        kind: its type, e.g. `Xform`.
        name: its name, unique among its siblings.
        schemas: names of the API schemas that are applied to it.
        properties: declaration, e.g. `float physics:mass` -> the value as text.
    """

    kind: str
    name: str
    schemas: Sequence[str] = ()
    properties: dict[str, str] = field(default_factory=dict[str, str])
    children: list[Prim] = field(default_factory=list["Prim"])

    def lines(self, indent: str = "") -> Iterator[str]:
        """Yield the lines of its text."""
        yield f'{indent}def {self.kind} "{self.name}"' + (" (" if self.schemas else "")
        if self.schemas:
            names = ", ".join(f'"{name}"' for name in self.schemas)
            yield f"{indent}    prepend apiSchemas = [{names}]"
            yield f"{indent})"
        yield indent + "{"
        for declaration, value in self.properties.items():
            yield f"{indent}    {declaration} = {value}"
        for child in self.children:
            yield from child.lines(indent + "    ")
        yield indent + "}"


def layer(root: Prim) -> str:
    """Return the text of a layer whose default prim is `root`."""
    return HEADER.format(root=root.name) + "\n".join(root.lines()) + "\n"


def numbers(values: Array) -> str:
    """Return a vector or a quaternion, wxyz, as a tuple of USD; every number survives the way."""
    return f"({', '.join(repr(float(v)) for v in np.asarray(values).ravel())})"


def placed(pos: Array, quat: Array, scale: Array | None = None) -> dict[str, str]:
    """Return the properties that put a prim at `pos` (3,) [m], turned by `quat` (4,) wxyz, in its parent's frame."""
    order = '["xformOp:translate", "xformOp:orient"' + ("" if scale is None else ', "xformOp:scale"') + "]"
    scaled = {} if scale is None else {"double3 xformOp:scale": numbers(scale)}
    return {
        "double3 xformOp:translate": numbers(pos),
        "quatd xformOp:orient": numbers(quat),
        **scaled,
        "uniform token[] xformOpOrder": order,
    }


ROBOT, HALL = "Robot", "Hall"
"""Names of the two layers' default prims."""


def robot_layer(model: mujoco.MjModel) -> str:
    """Return the robot of `model` as a USD layer: an articulation whose links and joints have the model's names.

    A joint has the model's damping as a drive of velocity, and its armature. Dry friction is not in it. A finger's
    hinge has the drive `FINGER_DRIVE`. Raises ConfigError: something else than the robot moves, or a shape has no
    counterpart.
    """
    root = model.body(BASE_LINK).id
    mine = model.body_rootid == model.body_rootid[root]
    if not mine[model.jnt_bodyid].all() or (model.body_mocapid >= 0).any():
        raise ConfigError("In Isaac Lab only the robot moves: its worlds are those without a pack, kitchen or people.")
    prim = Prim(
        "Xform",
        ROBOT,
        ("PhysicsArticulationRootAPI", "PhysxArticulationAPI"),
        {
            "bool physxArticulation:enabledSelfCollisions": "0",
            "int physxArticulation:solverPositionIterationCount": str(other_engine.POSITION_ITERATIONS),
            "int physxArticulation:solverVelocityIterationCount": str(other_engine.VELOCITY_ITERATIONS),
            "float physxArticulation:sleepThreshold": "0",
            "float physxArticulation:stabilizationThreshold": "0",
        },
    )
    place = mujoco.MjData(model)
    mujoco.mj_kinematics(model, place)
    origin = place.xpos[root]
    sliding = {float(model.geom_friction[g, 0]) for body in np.flatnonzero(mine) for g in touchable(model, body)}
    joints = Prim("Scope", "joints")  # apart, since a finger's link and its hinge have one name
    for body in np.flatnonzero(mine):
        name = model.body(body).name
        shapes = [_shape(model, g, _material(ROBOT, float(model.geom_friction[g, 0]))) for g in touchable(model, body)]
        prim.children.append(
            Prim(
                "Xform",
                name,
                ("PhysicsRigidBodyAPI", "PhysicsMassAPI", "PhysxRigidBodyAPI"),
                {
                    "float physics:mass": repr(float(model.body_mass[body])),
                    "point3f physics:centerOfMass": numbers(model.body_ipos[body]),
                    "float3 physics:diagonalInertia": numbers(model.body_inertia[body]),
                    "quatf physics:principalAxes": numbers(model.body_iquat[body]),
                    "float physxRigidBody:angularDamping": "0",
                    "float physxRigidBody:linearDamping": "0",
                    **placed(place.xpos[body] - origin, place.xquat[body]),
                },
                shapes,
            )
        )
        if body != root:
            joints.children.append(_joint(model, int(body)))
    prim.children += [joints, _materials(sliding)]
    return layer(prim)


def world_layer(model: mujoco.MjModel, friction: float) -> str:
    """Return what of `model` stays where it is as a USD layer. Raises ConfigError: a shape has no counterpart.

    Args:
        model: see `robot_layer`.
        friction: sliding friction of its surfaces.
    """
    place = mujoco.MjData(model)
    mujoco.mj_kinematics(model, place)
    root = model.body(BASE_LINK).id
    hall = Prim("Xform", HALL, children=[_materials({friction})])
    for body in np.flatnonzero(model.body_rootid != model.body_rootid[root]):
        shapes = [_shape(model, g, _material(HALL, friction)) for g in touchable(model, body)]
        if shapes:
            hall.children.append(Prim("Xform", f"body_{body}", (), placed(place.xpos[body], place.xquat[body]), shapes))
    return layer(hall)


def _material(root: str, friction: float) -> str:
    """Return the path of a material below the default prim `root`."""
    return f"/{root}/materials/friction_{round(1000 * friction)}"


def _materials(frictions: set[float]) -> Prim:
    """Return a prim with one material for each sliding friction."""
    scope = Prim("Scope", "materials")
    for friction in sorted(frictions):
        properties = {
            "float physics:dynamicFriction": repr(friction),
            "float physics:restitution": "0",
            "float physics:staticFriction": repr(friction),
        }
        name = _material("", friction).rsplit("/", 1)[1]
        scope.children.append(Prim("Material", name, ("PhysicsMaterialAPI",), properties))
    return scope


def _shape(model: mujoco.MjModel, g: int, material: str) -> Prim:
    """Return a collision shape; those of USD go by z, as MuJoCo's do."""
    kinds = mujoco.mjtGeom
    kind, (a, b, c) = kinds(int(model.geom_type[g])), (float(v) for v in model.geom_size[g])
    scale = None
    if kind == kinds.mjGEOM_PLANE:
        name, own = "Plane", {"uniform token axis": '"Z"'}
    elif kind == kinds.mjGEOM_SPHERE:
        name, own = "Sphere", {"double radius": repr(a)}
    elif kind == kinds.mjGEOM_CAPSULE:
        name, own = "Capsule", {"double radius": repr(a), "double height": repr(2 * b)}
    elif kind == kinds.mjGEOM_CYLINDER:
        name, own = "Cylinder", {"double radius": repr(a), "double height": repr(2 * b)}
    elif kind == kinds.mjGEOM_BOX:
        name, own, scale = "Cube", {"double size": "2"}, np.array([a, b, c])
    else:
        raise ConfigError(f"Isaac Lab has no shape for the geom '{model.geom(g).name}', a {kind.name}.")
    return Prim(
        name,
        f"shape_{g}",
        ("PhysicsCollisionAPI", "PhysxCollisionAPI", "MaterialBindingAPI"),
        {
            **own,
            "rel material:binding:physics": f"<{material}>",
            "float physxCollision:contactOffset": repr(CONTACT_OFFSET),
            "float physxCollision:restOffset": "0",
            **placed(model.geom_pos[g], model.geom_quat[g], scale),
        },
    )


def _joint(model: mujoco.MjModel, body: int) -> Prim:
    parent = model.body(int(model.body_parentid[body])).name
    pos, quat, none = model.body_pos[body], model.body_quat[body], np.zeros(3)
    ends = {
        "rel physics:body0": f"</{ROBOT}/{parent}>",
        "rel physics:body1": f"</{ROBOT}/{model.body(body).name}>",
        "point3f physics:localPos0": numbers(pos),
        "point3f physics:localPos1": numbers(none),
    }
    if model.body_jntnum[body] == 0:
        ends |= {"quatf physics:localRot0": numbers(quat), "quatf physics:localRot1": "(1, 0, 0, 0)"}
        return Prim("PhysicsFixedJoint", f"{model.body(body).name}_mount", (), ends)
    j = int(model.body_jntadr[body])
    v = int(model.jnt_dofadr[j])
    name = model.joint(j).name
    turn, inside = quat_to_axis(model.jnt_axis[j]), np.empty(4)
    mujoco.mju_mulQuat(inside, quat, turn)
    stiffness, damping = FINGER_DRIVE if name in follower_names() else (0.0, float(model.dof_damping[v].sum()))
    limits = {}
    if model.jnt_limited[j]:
        low, high = (repr(float(angle)) for angle in np.degrees(model.jnt_range[j]))
        limits = {"float physics:lowerLimit": low, "float physics:upperLimit": high}
    degree = np.pi / 180.0
    return Prim(
        "PhysicsRevoluteJoint",
        name,
        ("PhysicsDriveAPI:angular", "PhysxJointAPI"),
        {
            **ends,
            "uniform token physics:axis": '"X"',
            "quatf physics:localRot0": numbers(inside),
            "quatf physics:localRot1": numbers(turn),
            **limits,
            "uniform token drive:angular:physics:type": '"force"',
            "float drive:angular:physics:stiffness": repr(stiffness * degree),
            "float drive:angular:physics:damping": repr(damping * degree),
            "float physxJoint:armature": repr(float(model.dof_armature[v])),
            "float physxJoint:jointFriction": "0",
        },
    )
