"""One thin node per slot: reads the bus, runs the passive module once, publishes what it returns."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from golem.capabilities.arms.base import HasWaist, UpperBody
from golem.capabilities.arms.trajectory import TrajectoryFollower
from golem.hardware.estimator.base import BaseEstimator
from golem.hardware.hands.base import HandController
from golem.hardware.servo.base import MotorServo
from golem.interfaces import topics
from golem.interfaces.payloads import ArmCommand, GateState, HandStatus, JointTrajectory
from golem.kernels import njit
from golem.middleware.bus import Bus, News
from golem.native import HasStage
from golem.robots.model.spatial import seen_from
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.runtime.chain import HasLink, Link
from golem.runtime.contract_check import ContractCheck
from golem.runtime.executor import Node
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.runner import LACKS, SkillRun
from golem.types import (
    LEGS,
    NUM_JOINTS,
    TICK,
    UPPER,
    Array,
    BaseEstimate,
    HandCommand,
    LowCommand,
    LowState,
    PalmTargets,
    Side,
)

ROUNDING = 1e-3
"""How far targets may exceed a limit [rad]: sums of steps and single precision."""
BEGINNING = 0.1
"""How much further the first targets after a reset may be from the measured joints [rad]: a controller with narrower
limits of its own, or with an encoder's offset at a limit, starts inside them."""


@njit(cache=True, nogil=True)
def _furthest(q: Array, lower: Array, upper: Array) -> tuple[int, float]:
    """Return which of `q` (n,) is furthest outside its range, and by how much; negative where all are inside."""
    worst, excess = 0, -math.inf
    for i in range(len(q)):
        outside = max(lower[i] - q[i], q[i] - upper[i])
        if outside > excess:
            worst, excess = i, outside
    return worst, excess


class ArmLimits:
    """Remembers the targets of the previous tick, and compares."""

    def __init__(self, contract: ContractCheck, period: float) -> None:
        """Watch the module of `contract`, which runs every `period` [s]."""
        limits = load_limits()
        self._contract, self._period = contract, period
        self._lower: Array = limits.lower[UPPER]
        self._upper: Array = limits.upper[UPPER]
        self._step: Array = limits.velocity[UPPER] * period + ROUNDING
        self._q: Array = np.empty(len(self._lower))
        self._last: Array | None = None
        self._slack = 0.0

    def reset(self, q: Array) -> None:
        """Start from the measured joints `q` (27,) [rad]."""
        self._last = np.clip(q[UPPER], self._lower, self._upper)
        self._slack = BEGINNING

    def check(self, q: Array) -> None:
        """Check the targets `q` (15,) of this tick [rad].

        Raises ModuleFault: one is outside its position limits, or further from the previous one than its joint can
        move.
        """
        self._q[:] = q
        i, excess = _furthest(self._q, self._lower, self._upper)
        if excess > ROUNDING:
            raise self._contract.fault(
                f"it sends {_joint(i)} to {q[i]:.3g} rad, outside its limits, "
                f"{self._lower[i]:.3g} to {self._upper[i]:.3g} rad"
            )
        if self._last is not None:
            i, excess = _furthest(self._q - self._last, -self._step, self._step)
            if excess > self._slack:
                raise self._contract.fault(
                    f"its target of {_joint(i)} jumps by {abs(q[i] - self._last[i]):.3g} rad in a tick of "
                    f"{self._period:g} s; the joint moves {self._step[i] - ROUNDING:.3g} rad at most"
                )
        self._last, self._slack = self._q.copy(), 0.0


def _joint(i: int) -> str:
    return JOINT_NAMES[UPPER][i]


MIN_RATE = 1.0
"""Slowest controller that is taken for one [Hz]."""


IDENTITY = np.eye(3)


class EstimatorNode(HasLink):
    """Runs the base estimator on every state."""

    period = TICK

    def __init__(self, bus: Bus, estimator: BaseEstimator, contract: ContractCheck) -> None:
        self._bus, self._estimator, self._contract = bus, estimator, contract
        contract.times.allowed = self.period
        self._started = False

    def link(self) -> Link | None:
        stage = self._estimator.native() if isinstance(self._estimator, HasStage) else None
        if stage is None:
            return None
        # The first state is the node's: it resets the estimator.
        ready: Callable[[float], bool] = lambda t: self._started  # noqa: E731
        return Link(self, stage, (topics.LOW_STATE,), (topics.BASE,), ready)

    def step(self, t: float) -> None:
        state = self._bus.latest(topics.LOW_STATE)
        if state is None:
            return
        if not self._started:
            self._started = True
            self._contract.call(self._estimator.reset, state)
        estimate = self._contract.call(self._estimator.step, state, TICK)
        self._contract.kind("the estimate", estimate, BaseEstimate)
        T = self._contract.array("T_odom_base", estimate.T_odom_base, 4, 4)
        # A rotation to 1e-3: `check_pose` at 500 Hz would cost more than the estimate.
        if np.abs(T[:3, :3] @ T[:3, :3].T - IDENTITY).max() > 1e-3:
            raise self._contract.fault("T_odom_base is not a rigid transform")
        self._contract.array("velocity", estimate.velocity, 3)
        self._contract.array("contact", estimate.contact, 2)
        self._contract.number("height", estimate.height)
        self._contract.number("t", estimate.t)
        self._bus.publish(topics.BASE, estimate, t)


class UpperBodyNode(Node):
    """Runs the upper-body controller at its rate, its targets brought from odom into base_link.

    A joint trajectory that is newer than the palm targets is followed instead. The arms stay where it ends, and the
    controller goes on from there when palm targets come.
    """

    def __init__(self, bus: Bus, arms: UpperBody, contract: ContractCheck) -> None:
        self._bus, self._arms, self._contract = bus, arms, contract
        self._latency = contract.number("latency", arms.latency, minimum=0.0)
        self.period = 1.0 / contract.number("rate", arms.rate, minimum=MIN_RATE)
        self._limits = ArmLimits(contract, self.period)
        contract.times.allowed = self.period + self._latency
        self._stopped_at = 0.0
        self._turn_waist = arms.turn_waist if isinstance(arms, HasWaist) else None
        self._waist: float | None = None
        self._follower = TrajectoryFollower()
        self._followed: JointTrajectory | None = None
        self._command: Array | None = None

    def step(self, t: float) -> None:
        state = self._bus.latest(topics.LOW_STATE)
        base = self._bus.latest(topics.BASE)
        if state is None or base is None:
            return
        if not moving(self._bus):
            self._stopped_at = t
            self._contract.call(self._arms.reset, state.q)
            self._limits.reset(state.q)
            self._followed = self._command = None
        targets = self._bus.latest(topics.PALM_TARGETS)
        trajectory = self._bus.latest(topics.ARM_TRAJECTORY)
        if trajectory is not None and self._counts(trajectory, targets):
            if trajectory is not self._followed:
                start = state.q[UPPER] if self._command is None else self._command
                self._follower.start(trajectory, start)
                self._followed = trajectory
            command = self._follower.step(t, self.period)
        else:
            command = self._to_palms(targets, state, base)
        self._command = command.q
        self._bus.publish(topics.ARM_COMMAND, command, t, self._latency)

    def _counts(self, trajectory: JointTrajectory, targets: PalmTargets | None) -> bool:
        """Return whether `trajectory` has points, is from after the last stop, and no older than `targets`."""
        newest = targets is None or trajectory.t >= targets.t
        return newest and trajectory.t > self._stopped_at and len(trajectory.times) > 0

    def _to_palms(self, targets: PalmTargets | None, state: LowState, base: BaseEstimate) -> ArmCommand:
        if self._followed is not None:
            self._followed = None
            start = np.concatenate((state.q[: UPPER.start], self._follower.q))
            self._contract.call(self._arms.reset, start)
            self._limits.reset(start)
        left = right = waist = None
        # A target from before a stop must not set the arms in motion when the robot is released.
        if targets is not None and targets.t > self._stopped_at:
            T = base.T_odom_base
            left = None if targets.left is None else seen_from(T, targets.left)
            right = None if targets.right is None else seen_from(T, targets.right)
            waist = targets.torso
        if waist != self._waist and self._turn_waist is not None:
            self._waist = waist
            self._contract.call(self._turn_waist, waist)
        command = self._contract.call(self._arms.step, left, right, state.q, self.period)
        self._contract.kind("the arm command", command, ArmCommand)
        self._contract.arrays(UPPER.stop - UPPER.start, q=command.q)
        self._limits.check(command.q)
        return command


class HandNode(Node):
    """Runs the controller of one hand between the skills and the servos."""

    period = 0.01

    def __init__(self, bus: Bus, hand: HandController, side: Side, contract: ContractCheck) -> None:
        self._bus, self._hand, self._contract = bus, hand, contract
        contract.times.allowed = self.period
        self._side: Side = side
        self._goals = 0
        self._frozen = False

    def step(self, t: float) -> None:
        state = self._bus.latest(topics.hand_state(self._side))
        if state is None:
            return
        if moving(self._bus):
            self._frozen = False
            self._pass_goal()
        else:
            # While the gate is shut: keep what is held, else stay as it is; goals given meanwhile are void.
            self._goals = self._bus.count(topics.hand_goal(self._side))
            if not self._frozen:
                self._frozen = True
                if not self._contract.call(self._hand.status).holding:
                    self._contract.call(self._hand.open, state.gap)
        command = self._contract.call(self._hand.step, state, t)
        if type(command) is not HandCommand:
            self._contract.kind("the hand command", command, HandCommand)
        self._contract.number("gap", command.gap, minimum=0.0)
        self._contract.number("force", command.force, minimum=0.0)
        status = self._contract.call(self._hand.status)
        if type(status) is not HandStatus:
            self._contract.kind("the status", status, HandStatus)
        self._bus.publish(topics.hand_command(self._side), command, t)
        self._bus.publish(topics.hand_status(self._side), status, t)

    def _pass_goal(self) -> None:
        count = self._bus.count(topics.hand_goal(self._side))
        if count == self._goals:
            return
        goal = self._bus.latest(topics.hand_goal(self._side))
        if goal is None:
            return
        self._goals = count
        if goal.gap is None:
            self._contract.call(self._hand.close, goal.force)
        else:
            self._contract.call(self._hand.open, goal.gap)


class ServoNode(HasLink):
    """Runs motor control on the newest targets of legs and upper body."""

    period = TICK

    def __init__(self, bus: Bus, servo: MotorServo, contract: ContractCheck) -> None:
        self._bus, self._servo, self._contract = bus, servo, contract
        contract.times.allowed = self.period

    def link(self) -> Link | None:
        stage = self._servo.native() if isinstance(self._servo, HasStage) else None
        if stage is None:
            return None
        reads = topics.LOW_STATE, topics.SAFETY, topics.LEG_COMMAND, topics.ARM_COMMAND
        return Link(self, stage, reads, (topics.LOW_CMD_REQUEST,))

    def step(self, t: float) -> None:
        state = self._bus.latest(topics.LOW_STATE)
        if state is None:
            return
        if not moving(self._bus):
            self._contract.call(self._servo.reset, state)
        legs = self._bus.latest(topics.LEG_COMMAND)
        arms = self._bus.latest(topics.ARM_COMMAND)
        # A half that has not spoken yet stays where it is.
        q = state.q.copy()
        if legs is not None:
            q[LEGS] = legs.q
        if arms is not None:
            q[UPPER] = arms.q
        gains, tau = (None, None) if legs is None else ((legs.kp, legs.kd), legs.tau)
        command = self._contract.call(self._servo.step, state, q, TICK, gains, tau)
        self._contract.kind("the motor command", command, LowCommand)
        for name in ("q", "dq", "tau", "kp", "kd"):
            self._contract.array(name, getattr(command, name), NUM_JOINTS)
        self._bus.publish(topics.LOW_CMD_REQUEST, command, t)


class SkillNode(Node):
    """Resumes the running skill, and ends it for a module's fault, or once the lower body runs on its fallback.

    Attributes:
        run: the skill in execution, or None.
        live: whether what the machine lacks ends only the skill; in lock-step it is raised, as the user's to mend.
    """

    period = 0.01

    def __init__(self, context: Context) -> None:
        self._context = context
        self._faults = News(context.bus, topics.MODULE_FAULT)
        self.run: SkillRun | None = None
        self.live = False

    def step(self, t: float) -> None:
        """Resume the skill until its next await.

        No arm is drawn to where a skill that has ended, or a stop, left it: by then the robot may be elsewhere.
        """
        self._context.refresh(t)
        if self.run is None or self.run.result is not None or not moving(self._context.bus):
            self._context.release_arms()
        fault = self._faults.read()
        if self.run is None or self.run.result is not None:
            return
        if fault is not None:
            self.run.end(SkillResult(False, fault.stage, fault.slot, fault.reason, trace=fault.trace))
        legs = self._context.bus.latest(topics.LEG_STATUS)
        if legs is not None and legs.fault is not None:
            self.run.fail("lower_body", legs.fault, legs.trace)
        self.run.step()
        if isinstance(self.run.error, LACKS) and not self.live:
            raise self.run.error


def moving(bus: Bus) -> bool:
    """Return whether the safety gate lets commands through.

    While it does not, every controller starts over from the measured state at each step, so that a release finds all
    of them where the robot is.
    """
    status = bus.latest(topics.SAFETY)
    return status is not None and status.state is GateState.ACTIVE
