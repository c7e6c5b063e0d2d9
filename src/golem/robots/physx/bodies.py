"""What a compiled MuJoCo model is in PhysX: the robot as an articulation, the world as static and kinematic bodies."""

from __future__ import annotations

import importlib
import warnings
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from golem.errors import ConfigError, MissingExtra
from golem.robots.model.spatial import quat_to_axis
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.other_engine import CONTACT_OFFSET, POSITION_ITERATIONS, VELOCITY_ITERATIONS, touchable
from golem.types import Array

_ALONG_X = np.array([np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0])
"""Quaternion, wxyz, that turns x into z: PhysX's capsules, cylinders and planes go by x, MuJoCo's by z."""


def load_sapien() -> Any:
    """Return the module `sapien`, with which PhysX comes.

    Raises:
        MissingExtra: it is not installed.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that there is no Vulkan: nothing is rendered with it
            return importlib.import_module("sapien")
    except ImportError as error:
        raise MissingExtra("sapien", "physx") from error


@dataclass(frozen=True)
class PhysxBodies:
    """A world in PhysX, and which body of the MuJoCo model is what.

    Attributes:
        system: the PhysX system.
        articulation: the robot.
        links: body of the model -> link.
        joints: (n,) joints of the model in the articulation's order.
        kinematic: mocap body of the model -> body that is moved.
    """

    system: Any
    articulation: Any
    links: dict[int, Any]
    joints: np.ndarray
    kinematic: dict[int, Any]
    scene: Any


def build_bodies(model: mujoco.MjModel, friction: float) -> PhysxBodies:
    """Return the world of `model`.

    Args:
        model: the robot hangs on the free joint `base`, all else is static or moved from outside.
        friction: sliding friction of the world's surfaces; PhysX takes the mean of a pair's.

    Raises:
        ConfigError: something else has joints, or a shape is none of PhysX's.
        MissingExtra: SAPIEN is not installed.
    """
    sapien = load_sapien()
    maker = _Maker(sapien, model, friction)
    root = model.body(BASE_LINK).id
    mine = model.body_rootid == model.body_rootid[root]
    if not mine[model.jnt_bodyid].all():
        raise ConfigError("In PhysX only the robot moves: its worlds are those without a pack or a kitchen.")
    physx = sapien.physx
    config = physx.get_scene_config()
    config.gravity = model.opt.gravity.astype(np.float32)
    config.bounce_threshold = 0.2
    physx.set_scene_config(config)
    body = physx.get_body_config()
    body.sleep_threshold = 0.0
    body.solver_position_iterations = POSITION_ITERATIONS
    body.solver_velocity_iterations = VELOCITY_ITERATIONS
    physx.set_body_config(body)
    system = physx.PhysxCpuSystem()
    scene = sapien.Scene([system])
    links: dict[int, Any] = {}
    robot: list[Any] = []  # an entity lives as long as somebody holds it; it joins the scene once the robot is whole
    kinematic: dict[int, Any] = {}
    for i in range(model.nbody):
        if mine[i] and i >= root:
            entity, links[i] = maker.link(i, links.get(int(model.body_parentid[i])))
            robot.append(entity)
        elif model.body_mocapid[i] >= 0:
            kinematic[i] = maker.placed(i, physx.PhysxRigidDynamicComponent(), scene)
            kinematic[i].set_kinematic(True)
        elif (fixed := maker.static(i)) is not None:
            scene.add_entity(fixed)
    for entity in robot:
        scene.add_entity(entity)
    articulation = links[root].articulation
    joints = np.array([model.joint(joint.name).id for joint in articulation.get_active_joints()])
    return PhysxBodies(system, articulation, links, joints, kinematic, scene)


class _Maker:
    """Makes bodies of a model."""

    def __init__(self, sapien: Any, model: mujoco.MjModel, friction: float) -> None:
        self._sapien, self._physx, self._model = sapien, sapien.physx, model
        self._world = self._physx.PhysxMaterial(friction, friction, 0.0)
        self._places = mujoco.MjData(model)
        mujoco.mj_kinematics(model, self._places)

    def pose(self, pos: Array, quat: Array) -> Any:
        return self._sapien.Pose(np.asarray(pos, np.float32), np.asarray(quat, np.float32))

    def link(self, body: int, parent: Any) -> tuple[Any, Any]:
        """Return an entity and its link of the robot, with its joint."""
        model = self._model
        entity, link = self._sapien.Entity(), self._physx.PhysxArticulationLinkComponent(parent)
        self._shapes(link, body, foreign=False)
        entity.add_component(link)
        entity.name = model.body(body).name
        link.set_name(entity.name)
        link.set_mass(float(model.body_mass[body]))
        link.set_cmass_local_pose(self.pose(model.body_ipos[body], model.body_iquat[body]))
        link.set_inertia(model.body_inertia[body].astype(np.float32))
        link.set_linear_damping(0.0)  # PhysX brakes what moves through air by 5 % a second
        link.set_angular_damping(0.0)
        joint, inside = link.joint, self.pose(model.body_pos[body], model.body_quat[body])
        if parent is None:
            return entity, link
        if model.body_jntnum[body] == 0:
            joint.set_type("fixed")
            joint.set_pose_in_parent(inside)
            return entity, link
        j = int(model.body_jntadr[body])
        turn = self.pose(np.zeros(3), quat_to_axis(model.jnt_axis[j]))
        joint.set_type("revolute_unwrapped")
        joint.set_name(model.joint(j).name)
        joint.set_pose_in_parent(inside * turn)
        joint.set_pose_in_child(turn)
        # A joint without limits would be locked.
        limits = model.jnt_range[j] if model.jnt_limited[j] else np.array([-np.pi, np.pi])
        joint.set_limit(limits.astype(np.float32))
        v = int(model.jnt_dofadr[j])
        joint.set_armature(np.array([model.dof_armature[v]], np.float32))
        joint.set_friction(0.0)
        joint.set_drive_properties(0.0, float(model.dof_damping[v].sum()))
        return entity, link

    def static(self, body: int) -> Any | None:
        """Return a body that stays, or None if it touches nothing."""
        component = self._physx.PhysxRigidStaticComponent()
        if not self._shapes(component, body, foreign=True):
            return None
        return self._entity(body, component)

    def placed(self, body: int, component: Any, scene: Any) -> Any:
        """Add a body that is moved from outside, and return it."""
        self._shapes(component, body, foreign=True)
        scene.add_entity(self._entity(body, component))
        return component

    def _entity(self, body: int, component: Any) -> Any:
        entity = self._sapien.Entity()
        entity.add_component(component)
        entity.name = self._model.body(body).name
        entity.pose = self.pose(self._places.xpos[body], self._places.xquat[body])
        return entity

    def _shapes(self, component: Any, body: int, foreign: bool) -> bool:
        """Attach what of a body can be touched; return whether there is anything."""
        model = self._model
        geoms = touchable(model, body)
        for g in geoms:
            sliding = float(model.geom_friction[g, 0])
            material = self._world if foreign else self._physx.PhysxMaterial(sliding, sliding, 0.0)
            shape, turned = self._shape(g, material)
            pose = self.pose(model.geom_pos[g], model.geom_quat[g])
            shape.set_local_pose(pose * self.pose(np.zeros(3), _ALONG_X) if turned else pose)
            shape.set_contact_offset(CONTACT_OFFSET)
            shape.set_rest_offset(0.0)
            shape.set_collision_groups([int(model.geom_contype[g]), int(model.geom_conaffinity[g]), 0, 0])
            component.attach(shape)
        return bool(geoms)

    def _shape(self, g: int, material: Any) -> tuple[Any, bool]:
        """Return a shape, and whether it goes by x where MuJoCo's goes by z."""
        model, physx, kinds = self._model, self._physx, mujoco.mjtGeom
        kind, (a, b, c) = kinds(int(model.geom_type[g])), (float(v) for v in model.geom_size[g])
        if kind == kinds.mjGEOM_PLANE:
            return physx.PhysxCollisionShapePlane(material), True
        if kind == kinds.mjGEOM_SPHERE:
            return physx.PhysxCollisionShapeSphere(a, material), False
        if kind == kinds.mjGEOM_CAPSULE:
            return physx.PhysxCollisionShapeCapsule(a, b, material), True
        if kind == kinds.mjGEOM_CYLINDER:
            return physx.PhysxCollisionShapeCylinder(a, b, material), True
        if kind == kinds.mjGEOM_BOX:
            return physx.PhysxCollisionShapeBox(np.array([a, b, c], np.float32), material), False
        if kind == kinds.mjGEOM_MESH:
            mesh = int(model.geom_dataid[g])
            start = int(model.mesh_vertadr[mesh])
            points = model.mesh_vert[start : start + int(model.mesh_vertnum[mesh])]
            return physx.PhysxCollisionShapeConvexMesh(points, np.ones(3, np.float32), material), False
        raise ConfigError(f"PhysX has no shape for the geom '{model.geom(g).name}', a {kind.name}.")
