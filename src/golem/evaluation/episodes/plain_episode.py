"""A lower body on its own terms: the robot alone in plain MuJoCo, the policy's own gains, the true state.

No gate, no estimator, no latency, no hands; the upper body keeps still. What a policy survives here is its own doing;
what it loses in addition on the stack's terms (`golem.evaluation.episodes.episode`) is the stack's and the robot's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from golem import registry
from golem.capabilities.legs.base import Envelope, LowerBody
from golem.capabilities.legs.locomotion import Locomotion, LocomotionConfig
from golem.capabilities.legs.passports.read import read_passport
from golem.errors import ConfigError, ModuleFault
from golem.evaluation.episodes.episode import LOWER, NO_HEIGHT, Loss, with_legs
from golem.hardware.servo.gains import default_gains
from golem.interfaces.payloads import LegCommand
from golem.robots.model import mjcf
from golem.robots.model.imu_mount import TORSO, torso_motion
from golem.robots.model.table import BASE_LINK, load_limits
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.engine import standing_height
from golem.robots.mujoco.external_forces import Pushes
from golem.robots.mujoco.motors import Motors
from golem.robots.mujoco.scene import STICTION, read_robot
from golem.robots.mujoco.shoves import Push, Pusher
from golem.robots.mujoco.truth import Truth
from golem.runtime.contract_check import ContractCheck
from golem.runtime.lockstep import start_posture
from golem.runtime.lower_body_node import CheckedLowerBody
from golem.skills.base import FAULT
from golem.stack import Choice, Stack
from golem.types import LEGS, NUM_JOINTS, TICK, UPPER, Array, BaseEstimate, Imu, LowCommand, LowState, Twist

_UP: Array = np.array([0.0, 0.0, 9.81])


def plain_model(path: Path | None = None) -> mujoco.MjModel:
    """Return the robot on a floor, without hands: ours, or that of the MJCF file `path` with its own options.

    Raises ConfigError: the file cannot be read, or holds no such robot.
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
        base, rate = self._data.qpos[self._q + 3 : self._q + 7], self._data.qvel[self._v + 3 : self._v + 6]
        quat, gyro = torso_motion(base, rate, float(q[TORSO]), float(dq[TORSO]))
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, quat)
        return LowState(self.t, q, dq, tau, Imu(quat, gyro, _UP @ R.reshape(3, 3)))

    def base(self) -> BaseEstimate:
        """Return the true base, in the words of an estimate."""
        return self.truth.estimate(self.t)


START_NOISE = 0.02
"""Bound of what each joint is off its posture by when a trial begins [rad] [own: trials of a robot that stands would
otherwise be one trial many times]."""
BARE = LocomotionConfig(acceleration=(math.inf, math.inf, math.inf), trim=None, foot_separation=None)
"""The base layer of a policy from outside: its gait clock and its dead band, as its authors deploy it, and no more."""


class PlainEpisode:
    """A robot on its own terms that is pushed and recorded; see `golem.evaluation.episodes.episode.Episode`.

    Attributes:
        recorder: samples the robot's balance after every tick.
        twist: what is commanded; None is nothing.
        loss: how the robot was lost; None while it was not.
    """

    def __init__(self, method: str, path: Path | None, rng: np.random.Generator) -> None:
        """Place the robot in the posture of the lower body `method` (see `with_legs`), nearly.

        Args:
            method: what moves the legs. A policy from outside runs without our base layer (`BARE`), its upper body
                still in the posture of its description; any other lower body with it, its arms at home.
            path: MJCF file of the robot; None is ours.
            rng: draws by how much each joint is off that posture.

        Raises:
            ConfigError: a name, an option or the MJCF is wrong, or the lower body needs the robot's own computer.
            ModuleFault: its constructor raised.
        """
        choice = own_legs(method)
        self._contract = ContractCheck("lower_body", choice.use)
        controller = registry.create("lower_body", choice.use, choice.options)
        self._contract.satisfies(controller, LowerBody)
        self._legs = CheckedLowerBody(controller, self._contract)
        from_outside = choice.use == "policy"
        self._locomotion = Locomotion(controller, BARE if from_outside else None)
        posture = _posture(choice) if from_outside else start_posture(on_ground=True)
        limits = load_limits()
        start = posture + rng.uniform(-START_NOISE, START_NOISE, NUM_JOINTS)
        self._robot = PlainRobot(path, np.clip(start, limits.lower, limits.upper))
        self._upper = posture[UPPER]
        gains = default_gains()
        self._gains = gains.kp[UPPER], gains.kd[UPPER]
        self.recorder = BalanceRecorder(self._robot)
        self.twist: Twist | None = None
        self.loss: Loss | None = None
        self._pusher = Pusher(self._robot)
        self._contract.call(self._locomotion.reset, self._robot.state())

    @property
    def t(self) -> float:
        return self._robot.t

    @property
    def over(self) -> bool:
        return self.loss is not None

    @property
    def envelope(self) -> Envelope:
        """The twists that the lower body can follow."""
        return self._legs.controller.envelope

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        end = self.t + seconds - TICK / 2
        while not self.over and self.t < end:
            self._tick()
            if until():
                return

    def lower(self, height: float) -> None:
        """Bring the robot to a `height` [m]; legs that take none are lost."""
        self.twist = Twist(height=height)
        self.loss = NO_HEIGHT if self.envelope.height is None else None
        self.run(LOWER)

    def push(self, push: Push) -> None:
        self._pusher.begin(push, self.t, self.recorder.yaw)

    def close(self) -> None:
        """Release nothing: there are no images."""

    def _tick(self) -> None:
        state, base = self._robot.state(), self._robot.base()
        try:
            command = self._contract.call(self._locomotion.step, state, base, self.twist, TICK)
            self._legs.check(command)
        except ModuleFault as fault:
            self.loss = Loss(FAULT, fault.reason, fault.trace)
            return
        self._robot.advance(self._motor_command(command))
        self.recorder(self.t, self._pusher.force)
        self._pusher.drive(self.t)
        if self.recorder.fallen:
            self.loss = Loss("fall", f"The robot fell at {self.t:.1f} s.")

    def _motor_command(self, legs: LegCommand) -> LowCommand:
        q, kp, kd, tau = np.zeros((4, NUM_JOINTS))
        q[LEGS], kp[LEGS], kd[LEGS] = legs.q, legs.kp, legs.kd
        if legs.tau is not None:
            tau[LEGS] = legs.tau
        q[UPPER], (kp[UPPER], kd[UPPER]) = self._upper, self._gains
        return LowCommand(self.t, q, np.zeros(NUM_JOINTS), tau, kp, kd)


def own_legs(method: str) -> Choice:
    """Return the lower body `method` on its own terms. Raises ConfigError: it needs the robot's own computer."""
    choice = with_legs(Stack(), method).choice("lower_body")
    if choice.use == "vendor":
        raise ConfigError("vendor runs on the robot's own computer, which is not there on its own terms.")
    return choice


def _posture(choice: Choice) -> Array:
    """Return the (27,) posture of the description that the policy `choice` names."""
    return read_passport(str(choice.options["file"]), choice.options.get("network")).description.q0()
