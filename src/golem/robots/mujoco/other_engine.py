"""What twins in other engines share: the MuJoCo twin whose motion another solver has integrated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import mujoco
import numpy as np

from golem.errors import ConfigError
from golem.robots.model.magpie_model import FINGERS, finger_names
from golem.robots.mujoco.config import MujocoConfig, World
from golem.robots.mujoco.engine import MujocoRobot
from golem.types import SIDES, Array

WORLDS = ("open", "slope", "step", "rubble", "furnished", "corridor")
"""Those in which only the robot moves."""
FINGER_DRIVE = 20.0, 0.2
"""Stiffness [N m/rad] and damping [N m s/rad] with which a finger's hinge follows its crank, as its rocker has it."""
CONTACT_OFFSET = 0.004
"""Distance from which PhysX looks at a pair of shapes [m]."""
POSITION_ITERATIONS, VELOCITY_ITERATIONS = 16, 4
"""Iterations of PhysX's solver [own: with fewer a standing robot sinks into its knees between two steps]."""
SLIP = 0.05
"""Speed of a joint from which its dry friction is whole [rad/s] [own: without a slope it would chatter]."""


def follower_names() -> dict[str, str]:
    """Return hinge of a finger -> hinge of the crank that it follows, turning the other way."""
    pairs = [finger_names(side, finger) for side in SIDES for finger in FINGERS]
    return {finger: crank for crank, finger, _ in pairs}


def touchable(model: mujoco.MjModel, body: int | np.integer[Any]) -> list[int]:
    """Return the geoms of a body that can touch anything."""
    first = int(model.body_geomadr[body])
    geoms = range(first, first + int(model.body_geomnum[body]))
    return [g for g in geoms if model.geom_contype[g] or model.geom_conaffinity[g]]


@dataclass(frozen=True)
class OtherEngineConfig(MujocoConfig):
    """Options of a twin in another engine: those of the MuJoCo twin that it can keep.

    Attributes:
        ENGINE: its name, in sentences.
        world: one in which only the robot moves.
    """

    ENGINE: ClassVar[str] = ""

    world: World = "open"

    def __post_init__(self) -> None:
        super().__post_init__()
        for what, given in (
            ("self_collision", bool(self.self_collision)),
            ("cone", self.cone is not None),
            ("noslip", self.noslip > 0),
        ):
            if given:
                raise ConfigError(f"The twin in {self.ENGINE} does not have the option {what}.")
        if self.world not in WORLDS:
            raise ConfigError(
                f"In {self.ENGINE} only the robot moves, no screw and no door; choose another world: "
                f"{', '.join(WORLDS)}."
            )


@dataclass(frozen=True, slots=True)
class Motion:
    """Where another engine has the robot after a step.

    Attributes:
        pos, quat: (3,) [m] and (4,) wxyz of base_link in the world.
        base, torso: linear velocity of the link's origin [m/s] and angular velocity [rad/s] in the world, (3,) each.
        q: (n,) joints [rad], in the order of `JointMap`.
    """

    pos: Array
    quat: Array
    base: tuple[Array, Array]
    torso: tuple[Array, Array]
    q: Array


class JointMap:
    """Indices (n,) into a model's `qpos` and `qvel` of another engine's joints, in that engine's order."""

    def __init__(self, model: mujoco.MjModel, joints: np.ndarray) -> None:
        """Map `joints` (n,), ids of the model in the engine's order."""
        self.q, self.v = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self._loss = model.dof_frictionloss[self.v]
        # The transmission of a motor is its joint; a joint without one has none.
        motors = {int(model.actuator_trnid[a, 0]): a for a in range(model.nu)}
        self._motored = np.array([int(j) in motors for j in joints])
        self._ctrl = np.array([motors[int(j)] for j in joints if int(j) in motors])

    def torques(self, data: mujoco.MjData) -> Array:
        """Return the (n,) torques of motors and dry friction [N m]."""
        torques = -self._loss * np.tanh(data.qvel[self.v] / SLIP)
        torques[self._motored] += data.ctrl[self._ctrl]
        return torques


class OtherEngineRobot(MujocoRobot):
    """A MuJoCo twin whose `_step` another engine makes; `_follow` puts the model where that engine has the robot."""

    def _begin(self, joints: np.ndarray) -> None:
        """Take the engine's joints (n,), ids of the model in the engine's order; the robot is at rest."""
        self._joint_map = JointMap(self._model, joints)
        self._site = self._model.site("imu")
        self._imu_velocity = np.zeros(3)

    def _follow(self, motion: Motion, dt: float) -> None:
        """Put the model where `motion` says, and take the specific force at the IMU over the step of `dt` [s].

        The speed of a joint is how far it went, as its encoder has it: PhysX moves bodies out of each other without a
        speed that says so.
        """
        data, site = self.data, self._site.id
        base, v = self._base.qposadr[0], self._base.dofadr[0]
        data.qpos[base : base + 3], data.qpos[base + 3 : base + 7] = motion.pos, motion.quat
        data.qvel[self._joint_map.v] = (motion.q - data.qpos[self._joint_map.q]) / dt
        data.qpos[self._joint_map.q] = motion.q
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, data.qpos[base + 3 : base + 7])
        data.qvel[v : v + 3], data.qvel[v + 3 : v + 6] = motion.base[0], R.reshape(3, 3).T @ motion.base[1]
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        arm = data.site_xpos[site] - data.xpos[self._site.bodyid[0]]
        velocity = motion.torso[0] + np.cross(motion.torso[1], arm)
        felt = (velocity - self._imu_velocity) / dt - self._model.opt.gravity
        self._imu_velocity = velocity
        data.sensordata[self._acc] = data.site_xmat[site].reshape(3, 3).T @ felt
