"""The twin in PhysX 5: the same robot, motors, sensors and worlds, another solver of the motion."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from golem.errors import ConfigError
from golem.robots.model.magpie_model import FINGERS, finger_names
from golem.robots.mujoco.config import MujocoConfig, World
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.physx.bodies import PhysxBodies, build_bodies
from golem.robots.physx.physx_truth import PhysxTruth
from golem.types import SIDES, Array

FINGER_DRIVE = 20.0, 0.2
"""Stiffness [N m/rad] and damping [N m s/rad] with which a finger's hinge follows its crank, as its rocker has it."""
WORLDS = ("open", "slope", "step", "rubble", "furnished", "corridor")
SLIP = 0.05
"""Speed of a joint from which its dry friction is whole [rad/s] [own: without a slope it would chatter]."""


@dataclass(frozen=True)
class PhysxConfig(MujocoConfig):
    """Options of the twin in PhysX: those of the MuJoCo twin that it can keep.

    Attributes:
        world: one in which only the robot moves.
    """

    world: World = "open"

    def __post_init__(self) -> None:
        """Check the numbers, and refuse what PhysX cannot do.

        Raises:
            ConfigError: see above.
        """
        super().__post_init__()
        for what, given in (
            ("self_collision", bool(self.self_collision)),
            ("cone", self.cone is not None),
            ("noslip", self.noslip > 0),
        ):
            if given:
                raise ConfigError(f"The twin in PhysX does not have the option {what}.")
        if self.world not in WORLDS:
            raise ConfigError(
                f"In PhysX only the robot moves, no screw and no door; choose another world: {', '.join(WORLDS)}."
            )


class PhysxRobot(MujocoRobot):
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
        joints = self._bodies.joints
        self._q, self._v = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self._loss = model.dof_frictionloss[self._v]
        # The transmission of a motor is its joint; a joint without one has none.
        motors = {int(model.actuator_trnid[a, 0]): a for a in range(model.nu)}
        self._motored = np.array([int(j) in motors for j in joints])
        self._ctrl = np.array([motors[int(j)] for j in joints if int(j) in motors])
        self._root = self._bodies.articulation.get_root()
        active = self._bodies.articulation.get_active_joints()
        names = [joint.name for joint in active]
        self._followers = [
            (active[names.index(finger)], names.index(crank))
            for side in SIDES
            for crank, finger, _ in (finger_names(side, f) for f in FINGERS)
        ]
        for joint, _ in self._followers:
            joint.set_drive_properties(*FINGER_DRIVE)
        self._site, self._torso_link = model.site("imu"), self._bodies.links[model.body("torso_link").id]
        self._place()
        self.truth = PhysxTruth(model, self.data, self._bodies)

    def _place(self) -> None:
        """Put PhysX's robot where the model has it."""
        data, articulation = self.data, self._bodies.articulation
        base = self._base.qposadr[0]
        articulation.set_root_pose(self._pose(data.qpos[base : base + 3], data.qpos[base + 3 : base + 7]))
        articulation.set_qpos(data.qpos[self._q].astype(np.float32))
        articulation.set_qvel(np.zeros(len(self._q), np.float32))
        self._imu_velocity = np.zeros(3)

    def _pose(self, pos: Array, quat: Array) -> object:
        return type(self._root.entity_pose)(pos.astype(np.float32), quat.astype(np.float32))

    def _step(self) -> None:
        """Advance PhysX by one step under the torques and wrenches of the model's data, and follow it."""
        data, bodies, dt = self.data, self._bodies, float(self._model.opt.timestep)
        qf = -self._loss * np.tanh(data.qvel[self._v] / SLIP)
        qf[self._motored] += data.ctrl[self._ctrl]
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
        self._follow(dt)

    def _follow(self, dt: float) -> None:
        """Put the model where PhysX's robot is, and take the specific force at the IMU over the step."""
        data, articulation, root = self.data, self._bodies.articulation, self._root
        pose = root.entity_pose
        base, v = self._base.qposadr[0], self._base.dofadr[0]
        data.qpos[base : base + 3], data.qpos[base + 3 : base + 7] = pose.p, pose.q
        data.qpos[self._q], data.qvel[self._v] = articulation.get_qpos(), articulation.get_qvel()
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, data.qpos[base + 3 : base + 7])
        R = R.reshape(3, 3)
        rate = root.angular_velocity.astype(float)
        # PhysX's linear velocity is that of the centre of mass.
        lever = R @ root.cmass_local_pose.p.astype(float)
        data.qvel[v : v + 3] = root.linear_velocity.astype(float) - np.cross(rate, lever)
        data.qvel[v + 3 : v + 6] = R.T @ rate
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        torso = self._torso_link
        spin = torso.angular_velocity.astype(float)
        arm = data.site_xpos[self._site.id] - data.xipos[self._site.bodyid[0]]
        velocity = torso.linear_velocity.astype(float) + np.cross(spin, arm)
        felt = (velocity - self._imu_velocity) / dt - self._model.opt.gravity
        self._imu_velocity = velocity
        data.sensordata[self._acc] = data.site_xmat[self._site.id].reshape(3, 3).T @ felt
