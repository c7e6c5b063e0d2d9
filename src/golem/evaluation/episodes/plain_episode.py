"""A lower body on its own terms: the robot alone in plain MuJoCo, the policy's own gains, the true state.

No gate, no estimator, no latency, no hands; the upper body keeps still. What a policy survives here is its own doing;
what it loses in addition on the stack's terms (`golem.evaluation.episodes.episode`) is the stack's and the robot's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from golem import registry
from golem.capabilities.legs.base import Envelope, LowerBody
from golem.capabilities.legs.locomotion import Locomotion, LocomotionConfig
from golem.capabilities.legs.passports.read import read_passport
from golem.errors import ConfigError, ModuleFault
from golem.evaluation.episodes.episode import LOWER, NO_HEIGHT, Loss, with_legs
from golem.hardware.servo.gains import default_gains
from golem.interfaces.payloads import LegCommand
from golem.robots.model.table import load_limits
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.plain_robot import PlainRobot
from golem.robots.mujoco.shoves import Push, Pusher
from golem.runtime.contract_check import ContractCheck
from golem.runtime.lockstep import start_posture
from golem.runtime.lower_body_node import CheckedLowerBody
from golem.skills.base import FAULT
from golem.stack import Choice, Stack
from golem.types import LEGS, NUM_JOINTS, TICK, UPPER, Array, LowCommand, LowState, Twist

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
        """Robot time [s]."""
        return self._robot.t

    @property
    def over(self) -> bool:
        """Whether the robot fell or lost its leg controller."""
        return self.loss is not None

    @property
    def envelope(self) -> Envelope:
        """The twists that the lower body can follow."""
        return self._legs.controller.envelope

    def state(self) -> LowState:
        """Return the true state of the joints."""
        return self._robot.state()

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Let up to `seconds` of robot time pass; a fall or `until()` ends it early."""
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
        """Begin `push` now; it goes on while the episode runs."""
        self._pusher.begin(push, self.t, self.recorder.yaw)

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
    """Return the lower body `method` (see `with_legs`) as it can run on its own terms.

    Raises:
        ConfigError: it needs the robot's own computer.
    """
    choice = with_legs(Stack(), method).choice("lower_body")
    if choice.use == "vendor":
        raise ConfigError("vendor runs on the robot's own computer, which is not there on its own terms.")
    return choice


def _posture(choice: Choice) -> Array:
    """Return the (27,) posture of the description that the policy `choice` names."""
    return read_passport(str(choice.options["file"]), choice.options.get("network")).description.q0()
