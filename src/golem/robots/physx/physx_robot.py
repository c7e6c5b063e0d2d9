"""The twin in PhysX 5: the same robot, motors, sensors and worlds, another solver of the motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import mujoco
import numpy as np

from golem.robots.mujoco.other_engine import FINGER_DRIVE, Motion, OtherEngineConfig, OtherEngineRobot, follower_names
from golem.robots.mujoco.truth import Truth
from golem.robots.physx.bodies import PhysxBodies, build_bodies
from golem.types import SIDES, Array


class PhysxTruth(Truth):
    """Poses from the model that follows PhysX, contacts from PhysX itself."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, bodies: PhysxBodies) -> None:
        """Read `data` of `model`, and the contacts of `bodies`."""
        super().__init__(model, data)
        self._bodies = bodies
        feet = [model.body(f"{side}_ankle_roll_link").name for side in SIDES]
        self._part_of = {
            link.name: feet.index(link.name) if link.name in feet else len(SIDES) for link in bodies.links.values()
        }

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
        """Return the force of the world on the left and the right foot, (2, 3) [N], in the world."""
        forces = np.zeros((2, 3))
        for name, impulse in self._touching():
            if self._part_of[name] < len(SIDES):
                forces[self._part_of[name]] += impulse / self._bodies.system.timestep
        return forces

    def touches(self) -> tuple[str, ...]:
        """Return the bodies other than the feet that touch something that is not the robot, sorted."""
        return tuple(sorted({name for name, _ in self._touching() if self._part_of[name] == len(SIDES)}))


@dataclass(frozen=True)
class PhysxConfig(OtherEngineConfig):
    """Options of the twin in PhysX; see `OtherEngineConfig`."""

    ENGINE: ClassVar[str] = "PhysX"


class PhysxRobot(OtherEngineRobot):
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
        self._followers = [
            (active[names.index(finger)], names.index(crank)) for finger, crank in follower_names().items()
        ]
        for joint, _ in self._followers:
            joint.set_drive_properties(*FINGER_DRIVE)
        self._torso_link = self._bodies.links[model.body("torso_link").id]
        self._place()
        self.truth = PhysxTruth(model, self.data, self._bodies)

    def _place(self) -> None:
        """Put PhysX's robot where the model has it."""
        data, articulation = self.data, self._bodies.articulation
        base = self._base.qposadr[0]
        articulation.set_root_pose(self._pose(data.qpos[base : base + 3], data.qpos[base + 3 : base + 7]))
        articulation.set_qpos(data.qpos[self._joint_map.q].astype(np.float32))
        articulation.set_qvel(np.zeros(len(self._joint_map.q), np.float32))

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
        self._follow(Motion(pose.p, pose.q, _motion_of(self._root), _motion_of(self._torso_link), q), dt)


def _motion_of(link: Any) -> tuple[Array, Array]:
    """Return velocity of a link's origin [m/s] and its rate [rad/s], (3,) each, in the world."""
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, link.entity_pose.q.astype(float))
    rate = link.angular_velocity.astype(float)
    # PhysX's linear velocity is that of the centre of mass.
    lever = R.reshape(3, 3) @ link.cmass_local_pose.p.astype(float)
    return link.linear_velocity.astype(float) - np.cross(rate, lever), rate
