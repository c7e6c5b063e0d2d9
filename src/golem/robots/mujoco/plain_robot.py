"""The robot alone in plain MuJoCo: motors and the true state, no hands, no sensors' errors, no delay."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from golem.robots.model import mjcf
from golem.robots.model.imu_mount import TORSO, torso_motion
from golem.robots.model.table import BASE_LINK, load_limits
from golem.robots.mujoco.engine import standing_height
from golem.robots.mujoco.external_forces import Pushes
from golem.robots.mujoco.motors import Motors
from golem.robots.mujoco.scene import STICTION, read_robot
from golem.robots.mujoco.truth import Truth
from golem.types import NUM_JOINTS, TICK, Array, BaseEstimate, Imu, LowCommand, LowState

_UP: Array = np.array([0.0, 0.0, 9.81])


def plain_model(path: Path | None = None) -> mujoco.MjModel:
    """Return the robot on a floor, without hands: ours, or that of the MJCF file `path` with its own options.

    Raises:
        ConfigError: the file cannot be read, or holds no such robot.
    """
    if path is None:
        spec = mjcf.robot_spec(hands=False, self_collision=True)
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.impratio = STICTION
    else:
        spec = read_robot(path)
    if not any(geom.type == mujoco.mjtGeom.mjGEOM_PLANE for geom in spec.worldbody.geoms):
        floor = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50.0, 50.0, 1.0])
        if path is None:
            floor.friction[0] = 0.05  # the pair takes the larger one: the sole's
    spec.option.timestep = TICK
    return spec.compile()


class PlainRobot:
    """The robot in plain MuJoCo, one physics step per tick."""

    def __init__(self, path: Path | None, posture: Array) -> None:
        """Stand in `posture` (27,) [rad] on the floor of `plain_model`."""
        self._model = plain_model(path)
        self._data = mujoco.MjData(self._model)
        self._pushes = Pushes(self._model)
        self._motors = Motors(self._model, load_limits().torque, np.zeros(NUM_JOINTS), 0.0)
        base = self._model.joint("base")
        self._q, self._v = int(base.qposadr[0]), int(base.dofadr[0])
        self._data.qpos[self._q : self._q + 7] = (0.0, 0.0, standing_height(posture), 1.0, 0.0, 0.0, 0.0)
        self._motors.place(self._data, posture)
        mujoco.mj_forward(self._model, self._data)
        self.truth = Truth(self._model, self._data)

    @property
    def t(self) -> float:
        """Time since the start [s]."""
        return self._data.time

    def push(self, force: Array, body: str = BASE_LINK, point: Array | None = None) -> None:
        """Push a link from outside; see `MujocoRobot.push`."""
        self._pushes.set(force, body, point)

    def advance(self, command: LowCommand) -> None:
        """Let one tick pass under `command`."""
        self._motors.give(command, self.t)
        self._motors.drive(self._data)
        self._pushes.clear(self._data)
        self._pushes.apply(self._data)
        mujoco.mj_step(self._model, self._data)

    def state(self) -> LowState:
        """Return the true joints, and what a torso IMU without acceleration would report."""
        q, dq, tau = self._motors.measure(self._data)
        quat, gyro = torso_motion(
            self._data.qpos[self._q + 3 : self._q + 7],
            self._data.qvel[self._v + 3 : self._v + 6],
            float(q[TORSO]),
            float(dq[TORSO]),
        )
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, quat)
        return LowState(self.t, q, dq, tau, Imu(quat, gyro, _UP @ R.reshape(3, 3)))

    def base(self) -> BaseEstimate:
        """Return the true base, in the words of an estimate."""
        return self.truth.estimate(self.t)
