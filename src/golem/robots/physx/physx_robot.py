"""The twin in PhysX 5: the same robot, motors, sensors and worlds, another solver of the motion."""

from __future__ import annotations

import importlib
import warnings
from dataclasses import dataclass
from typing import Any, ClassVar

import mujoco
import numpy as np

from golem.errors import ConfigError, needs
from golem.robots.model.spatial import quat_to_axis
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco import other_engine
from golem.robots.mujoco.truth import Truth
from golem.types import SIDES, Array

_ALONG_X = np.array([np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0])
"""Quaternion, wxyz, that turns x into z: PhysX's capsules, cylinders and planes go by x, MuJoCo's by z."""


def load_sapien() -> Any:
    """Return the module `sapien`, with which PhysX comes. Raises MissingExtra: it is not installed."""
    with needs("sapien", "physx"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that there is no Vulkan: nothing is rendered with it
            return importlib.import_module("sapien")


@dataclass(frozen=True)
class PhysxBodies:
    """A world in PhysX, and which body of the MuJoCo model is what.

    Attributes:
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
    body.solver_position_iterations = other_engine.POSITION_ITERATIONS
    body.solver_velocity_iterations = other_engine.VELOCITY_ITERATIONS
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
        return self._entity(body, component) if self._shapes(component, body, foreign=True) else None

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
        geoms = other_engine.touchable(model, body)
        for g in geoms:
            sliding = float(model.geom_friction[g, 0])
            material = self._world if foreign else self._physx.PhysxMaterial(sliding, sliding, 0.0)
            shape, turned = self._shape(g, material)
            pose = self.pose(model.geom_pos[g], model.geom_quat[g])
            shape.set_local_pose(pose * self.pose(np.zeros(3), _ALONG_X) if turned else pose)
            shape.set_contact_offset(other_engine.CONTACT_OFFSET)
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


class PhysxTruth(Truth):
    """Poses from the model that follows PhysX, contacts from PhysX itself."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, bodies: PhysxBodies) -> None:
        """Read `data` of `model`, and the contacts of `bodies`."""
        super().__init__(model, data)
        self._bodies = bodies
        feet = [model.body(f"{side}_ankle_roll_link").name for side in SIDES]
        self._part_of = {x.name: feet.index(x.name) if x.name in feet else len(SIDES) for x in bodies.links.values()}

    def _touching(self) -> list[tuple[str, Array]]:
        """Return the links that touch what is not the robot, and the impulse on each in the last step [N s]."""
        found: list[tuple[str, Array]] = []
        for contact in self._bodies.system.get_contacts():
            impulse = np.sum([point.impulse for point in contact.points], axis=0, initial=0.0)
            if not np.any(impulse):
                continue
            one, other = (body.entity.name for body in contact.bodies)
            if one in self._part_of and other not in self._part_of:
                found.append((one, impulse))
            elif other in self._part_of and one not in self._part_of:
                found.append((other, -impulse))
        return found

    def foot_forces(self) -> Array:
        forces = np.zeros((2, 3))
        for name, impulse in self._touching():
            if self._part_of[name] < len(SIDES):
                forces[self._part_of[name]] += impulse / self._bodies.system.timestep
        return forces

    def touches(self) -> tuple[str, ...]:
        return tuple(sorted({name for name, _ in self._touching() if self._part_of[name] == len(SIDES)}))


@dataclass(frozen=True)
class PhysxConfig(other_engine.OtherEngineConfig):
    """Options of the twin in PhysX; see `OtherEngineConfig`."""

    ENGINE: ClassVar[str] = "PhysX"


class PhysxRobot(other_engine.OtherEngineRobot):
    """The twin in PhysX; see `golem.robots.base.Robot`.

    Motors, hands, hoist, sensor errors and pictures are those of the MuJoCo twin, whose model is put where PhysX has
    the robot after every step. Limbs do not stop each other, and there is no world with a pack.
    """

    def __init__(self, profile: str, seed: int, posture: Array, config: PhysxConfig | None = None) -> None:
        """Build the world of one episode; see `MujocoRobot`.

        Raises:
            ConfigError: the profile or an option does not exist, or PhysX has no such world or robot.
            MissingExtra: SAPIEN is not installed.
        """
        config = config or PhysxConfig()
        super().__init__(profile, seed, posture, config)
        model = self._model
        self._bodies: PhysxBodies = build_bodies(model, config.friction)
        self._begin(self._bodies.joints)
        self._root = self._bodies.articulation.get_root()
        active = self._bodies.articulation.get_active_joints()
        names = [joint.name for joint in active]
        self._followers = [(active[names.index(f)], names.index(c)) for f, c in other_engine.follower_names().items()]
        for joint, _ in self._followers:
            joint.set_drive_properties(*other_engine.FINGER_DRIVE)
        self._torso_link = self._bodies.links[model.body("torso_link").id]
        data, articulation = self.data, self._bodies.articulation
        base = self._base.qposadr[0]
        articulation.set_root_pose(self._pose(data.qpos[base : base + 3], data.qpos[base + 3 : base + 7]))
        articulation.set_qpos(data.qpos[self._joint_map.q].astype(np.float32))
        articulation.set_qvel(np.zeros(len(self._joint_map.q), np.float32))
        self.truth = PhysxTruth(model, self.data, self._bodies)

    def _pose(self, pos: Array, quat: Array) -> object:
        return type(self._root.entity_pose)(pos.astype(np.float32), quat.astype(np.float32))

    def _step(self) -> None:
        """Advance PhysX by one step under the torques and wrenches of the model's data, and follow it."""
        data, bodies, dt = self.data, self._bodies, float(self._model.opt.timestep)
        qf = self._joint_map.torques(data)
        q = bodies.articulation.get_qpos()
        for joint, crank in self._followers:
            joint.set_drive_target(float(-q[crank]))
        bodies.articulation.set_qf(qf.astype(np.float32))
        for body in np.flatnonzero(data.xfrc_applied.any(axis=1)):
            wrench = data.xfrc_applied[body].astype(np.float32)
            bodies.links[int(body)].add_force_torque(wrench[:3], wrench[3:])
        for body, moved in bodies.kinematic.items():
            mocap = int(self._model.body_mocapid[body])
            moved.kinematic_target = self._pose(data.mocap_pos[mocap], data.mocap_quat[mocap])
        bodies.system.timestep = dt
        bodies.system.step()
        data.time += dt
        pose = self._root.entity_pose
        q = bodies.articulation.get_qpos().astype(float)
        self._follow(other_engine.Motion(pose.p, pose.q, _motion_of(self._root), _motion_of(self._torso_link), q), dt)


def _motion_of(link: Any) -> tuple[Array, Array]:
    """Return velocity of a link's origin [m/s] and its rate [rad/s], (3,) each, in the world."""
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, link.entity_pose.q.astype(float))
    rate = link.angular_velocity.astype(float)
    # PhysX's linear velocity is that of the centre of mass.
    lever = R.reshape(3, 3) @ link.cmass_local_pose.p.astype(float)
    return link.linear_velocity.astype(float) - np.cross(rate, lever), rate
