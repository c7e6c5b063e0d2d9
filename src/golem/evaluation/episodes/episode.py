"""One robot on its feet under judgement: the whole stack in lock-step, pushed and watched from outside.

Its odometry is an error model, no sensor: it adds noise to what the base estimator says, drift and all, nothing the
robot could not know.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from golem.errors import ConfigError
from golem.evaluation.base import Onlooker
from golem.evaluation.blame.oracles import with_modules
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import topics
from golem.interfaces.payloads import Odometry
from golem.middleware.bus import Bus
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.shoves import Push, Pusher
from golem.runtime.executor import when_stepped
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import FAULT, Routine, SkillResult
from golem.skills.context import Context
from golem.skills.runner import SkillRun
from golem.stack import Choice, Stack, load_stack
from golem.types import Array, Twist

POSITION_NOISE = 0.01
"""Standard deviation of x and of y [m]."""
YAW_NOISE = float(np.radians(1.0))
"""Standard deviation of the heading [rad]."""
PERIOD = 0.1
"""Time between two poses [s]: one turn of a LiDAR."""
ODOMETRY_LATENCY = 0.05
"""Time from a pose to its arrival [s]."""


class SimulatedOdometry:
    """Publishes `topics.ODOMETRY` for a twin; call it after every tick, or when the next pose is `due` [s]."""

    def __init__(self, bus: Bus, rng: np.random.Generator) -> None:
        """Tell `bus` where the base estimator has the robot, with independent noise of every pose drawn from `rng`."""
        self._bus, self._rng = bus, rng
        self.due = 0.0

    def __call__(self, t: float) -> None:
        """Publish a pose, if one is due at time `t` [s]."""
        if t < self.due - 1e-9:
            return
        self.due = t + PERIOD
        dx, dy = self._rng.normal(0.0, POSITION_NOISE, 2)
        turn = self._rng.normal(0.0, YAW_NOISE)
        base = self._bus.latest(topics.BASE)
        if base is None:
            return
        T = base.T_odom_base.copy()
        c, s = np.cos(turn), np.sin(turn)
        noise = np.eye(3)
        noise[:2, :2] = ((c, -s), (s, c))
        T[:3, :3] = noise @ T[:3, :3]
        T[:2, 3] += (dx, dy)
        self._bus.publish(topics.ODOMETRY, Odometry(t, T), t, ODOMETRY_LATENCY)


SLOT = "lower_body"
"""What methods that walk and stand are."""
STACK = "stand"
"""The shipped stack whose robot stands on its own feet."""
READY = 10.0
"""Time in which a robot has to carry its weight, so that its band is let go [s]: the vendor's start-up takes some."""
LATENCY = 0.02
"""Delay of motor commands on top of the profile's with which lower bodies are compared [s]."""
RUNS_FILES = ("policy", "vendor")
"""Lower bodies that run the files of a policy: the adapter, and the vendor's service on board."""


def with_legs(stack: Stack, method: str) -> Stack:
    """Return `stack` with the lower body a method stands for.

    Args:
        method: a registered name, a user's `file.py:Class` or `package.module:Class`, either with options as
            `{use: NAME, option: value}`, or the files of a policy as `policy:DESCRIPTION` or
            `policy:DESCRIPTION:NETWORK`; `vendor:DESCRIPTION:NETWORK` runs them on board.
    """
    name, *files = method.split(":")
    if name not in RUNS_FILES or not files:
        return stack.with_choice(SLOT, method)
    policy = Choice("policy", dict(zip(("file", "network"), files, strict=False)))
    if name == "vendor":
        return stack.with_choice(SLOT, name).with_choice("onboard", policy)
    return stack.with_choice(SLOT, policy)


def legs_stack(
    method: str, profile: str, overrides: Mapping[str, str] | None = None, robot: Mapping[str, object] | None = None
) -> Stack:
    """Return the standing stack with the lower body `method`.

    Args:
        method: see `with_legs`.
        overrides: slot -> implementation that replaces the stack's own; another twin keeps the options.
        robot: options of the twin that differ from the stack's own; without any, an open floor.

    Raises:
        ConfigError: `overrides` names the lower body, which is the method.
    """
    others = dict(overrides or {})
    if SLOT in others:
        raise ConfigError(f"The test of a lower body brings its own {SLOT}; leave out --use {SLOT}=...")
    stack = with_legs(load_stack(STACK, profile=profile), method)
    stack = stack.with_options("robot", **{"world": "open", **(robot or {})})
    twin = stack.choice("robot")
    other = stack.with_choice("robot", others.pop("robot", twin)).choice("robot")
    stack = stack.with_choice("robot", Choice(other.use, {**twin.options, **other.options}))
    return with_modules(stack, others)


def episode_seed(seed: int, index: int) -> int:
    """Return the twin's seed of trial `index`: far enough apart that runs of neighbouring seeds share no episode."""
    return seed * 1_000_003 + index


@dataclass(frozen=True, slots=True)
class Loss:
    """How a robot was lost.

    Attributes:
        stage: `settle` (it never carried its weight), `fall`, `safety` (its gate stopped it, as an operator's e-stop
            would) or `fault` (the leg controller broke its contract, and the fallback took over).
        trace: where in its code a module raised, as Python prints it; None where none did.
    """

    stage: str
    detail: str
    trace: str | None = None


LOWER = 4.0
"""Time that legs get to bring a robot to another height [s]."""
NO_HEIGHT = Loss("height", "These legs take no height and keep their own.")
"""A robot that was to stand at another height."""
HANGS = Loss("settle", f"The robot did not carry its weight within {READY:g} s.")
"""A robot whose band could not let go."""


def lost(running: LockstepRunner, recorder: BalanceRecorder | None) -> Loss | None:
    """Return how the robot of a stack was lost, if it was; `recorder` watched it since it stood, None in a hoist."""
    t, safety = running.executor.t, running.safety
    legs = running.bus.latest(topics.LEG_STATUS)
    if legs is not None and legs.fault is not None:
        return Loss(FAULT, legs.fault, legs.trace)
    if recorder is not None and recorder.fallen:
        return Loss("fall", f"The robot fell at {t:.1f} s.")
    if safety is not None and safety.stopped:
        return Loss("safety", f"Safety stop at {t:.1f} s: {safety.why}.")
    return None


class Episode:
    """A robot that pursues a skill while it is pushed and recorded.

    Attributes:
        recorder: samples the twin's balance after every tick.
        height: at which it is to stand [m]; None is that of its legs.
    """

    def __init__(
        self, stack: Stack, seed: int, onlooker: Onlooker | None = None, limits: SafetyLimits | None = None
    ) -> None:
        """Build `stack` for the twin's seed, and show it to `onlooker`; its gate enforces `limits` if given.

        Raises:
            ConfigError: the stack's robot is not the twin, or a name or an option is wrong.
            ModuleFault: a constructor raised.
        """
        self.running, robot = build(stack, seed, limits)
        if not isinstance(robot, MujocoRobot):
            raise ConfigError(
                f"Balance is judged on a simulator's truth; robot: {stack.choice('robot').use} is none of mujoco, "
                "physx and isaaclab."
            )
        self.robot = robot
        if onlooker is not None:
            onlooker(self.running, robot)
        self.recorder = BalanceRecorder(robot)
        self._pusher = Pusher(robot)
        self._odometry: SimulatedOdometry | None = None
        self._skill: SkillRun | None = None
        self._hangs = False
        self.height: float | None = None

    def start(self, skill: str | Routine[Context, Any], goal: object = None) -> None:
        """Begin a skill; it advances while the episode runs."""
        self._skill = self.running.start(skill, goal)

    def locate(self, rng: np.random.Generator) -> None:
        """Let a `SimulatedOdometry` with noise from `rng` say where the robot is, from now on."""
        self._odometry = SimulatedOdometry(self.running.bus, rng)

    @property
    def result(self) -> SkillResult | None:
        """How the skill ended; None while it runs."""
        return None if self._skill is None else self._skill.result

    @property
    def t(self) -> float:
        """Robot time [s]."""
        return self.running.executor.t

    @property
    def force(self) -> Array:
        """(3,) present force of the push in the world [N]."""
        return self._pusher.force

    @property
    def over(self) -> bool:
        """Whether the robot fell, was stopped, or lost its leg controller."""
        return self.loss is not None

    @property
    def loss(self) -> Loss | None:
        """How the robot was lost; None while it was not."""
        loss = lost(self.running, self.recorder)
        if self.height is not None and self.running.envelope.height is None:
            loss = loss or NO_HEIGHT
        # A controller that failed in its band never got to carry the weight.
        return HANGS if self._hangs and (loss is None or loss.stage != FAULT) else loss

    def stand(self, seconds: float) -> None:
        """Let the robot take over its weight and come to its height, then let `seconds` pass; else it is lost."""
        self.run(READY, until=lambda: not self.robot.on_gantry, due=when_stepped)
        self._hangs = self.robot.on_gantry
        if self.height is not None:
            self.running.bus.publish(topics.TWIST, Twist(height=self.height), self.t)
            self.run(LOWER)
        self.run(seconds)

    def run(
        self, seconds: float, until: Callable[[], bool] | None = None, due: Callable[[], float] | None = None
    ) -> None:
        """Let up to `seconds` of robot time pass; a fall, a stop or `until()` ends it early.

        Args:
            seconds: how long [s].
            until: asked after every tick.
            due: until when `until` may be left out [s], see `Executor.run`; None asks it after every tick.
        """
        if until is None:
            until, due = lambda: False, when_stepped
        ask, later = until, due
        both = None if later is None else lambda: min(later(), self._due())
        if not self.over:
            self.running.executor.run(self.t + seconds, lambda: self._look() or ask(), due=both)

    def _due(self) -> float:
        odometry = math.inf if self._odometry is None else self._odometry.due
        return min(self.recorder.due, self._pusher.due, odometry)

    def push(self, push: Push) -> None:
        """Begin `push` now; it goes on while the episode runs."""
        self._pusher.begin(push, self.t, self.recorder.yaw)

    def let_go(self) -> None:
        """Take the push away."""
        self._pusher.end()

    def close(self) -> None:
        """Release what the twin holds."""
        self.robot.close()

    def _look(self) -> bool:
        self.recorder(self.t, self.force)
        if self._odometry is not None:
            self._odometry(self.t)
        self._pusher.drive(self.t)
        return self.over
