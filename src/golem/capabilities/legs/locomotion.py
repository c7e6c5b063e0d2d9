"""The base layer of the lower body: what every leg controller gets done for it.

It judges the twist (finite, inside the envelope, recent), limits its acceleration, runs the gait clock from the
balance of the measured robot, and runs the controller at its own rate. The controller sees a `LocomotionCommand` that
it can follow.

Keeps a foot that swings beside the other one.

Shoved to a side, a robot that walks may set a foot down on the other one or across it, because its policy's targets say
so or because the leg lags behind them. Seen coming, it is prevented at one joint: the hip roll of the leg that swings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from golem.capabilities.legs.balance_errors import VelocityIntegrator, VelocityIntegratorConfig
from golem.capabilities.legs.base import STANDING, ZERO, LocomotionCommand, LowerBody, follows
from golem.capabilities.legs.gait import Bools, Gait
from golem.capabilities.legs.gait_clock import GaitClock, StopPredictor
from golem.capabilities.legs.handover import CommandBlender
from golem.capabilities.legs.rate_divider import RateDivider
from golem.interfaces.payloads import LegCommand
from golem.options import require
from golem.robots.model.leg_kernel import LEG, LegDynamics
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, BaseEstimate, LowState, PlanarPose, Twist

_ROLL = JOINT_NAMES.index("left_hip_roll_joint")
_Y = 1


@dataclass(frozen=True, slots=True)
class FootSeparationConfig:
    """Options of `FootSeparation`.

    Attributes:
        minimum: distance of the soles' centres across base_link below which the swinging leg is led outward [m]: soles
            are 0.08 m wide. Twice as much worsened the turning of a robot that walks fast and askew.
        lead: how far ahead it is extrapolated from how the feet move now [s]: what a leg needs to answer.
        gain: change of the hip roll's target per angle that is missing: the leg lags behind it by most of it.
        maximum: largest change [rad].
    """

    minimum: float = 0.08
    lead: float = 0.1
    gain: float = 4.0
    maximum: float = 0.8


class FootSeparation:
    """The correction of one robot's leg targets."""

    def __init__(self, config: FootSeparationConfig | None = None) -> None:
        self.config = config or FootSeparationConfig()
        self._legs = LegDynamics()

    def step(self, command: LegCommand, state: LowState, swings: Bools) -> LegCommand:
        """Return what the legs are told instead of `command`; `swings` (2,) says which leg carries no load."""
        if not swings.any():
            return command
        config, legs = self.config, self._legs
        legs.update(state.q[LEGS], state.dq[LEGS])
        across = legs.soles[:, _Y] + config.lead * legs.twists[:, _Y]
        missing = config.minimum - float(across[0] - across[1])
        if missing <= 0.0:
            return command
        lever = legs.jacobians[:, _Y, _ROLL]
        change = np.clip(config.gain * missing / lever, -config.maximum, config.maximum) * swings
        q = command.q.copy()
        q[_ROLL::LEG] += (1.0, -1.0) * change
        return replace(command, q=q)


NO_FLOOR = "the base estimate has not found the floor yet"
"""Why a robot that may hang in the air does not move."""


@dataclass(frozen=True, slots=True)
class LocomotionConfig:
    """Options of the base layer.

    Attributes:
        dead_band: norm of (vx, vy, wz) below which a twist does not start a robot that stands [m/s, rad/s]: ALMI's (and
            the paper's) 0.1.
        minimum: norm below which a twist counts as zero for a robot that walks: it may approach a goal slowly.
        acceleration: bounds on the change of vx, vy [m/s^2] and wz [rad/s^2] [own: full speed in less than a second].
        height_speed: bound on the change of the height [m/s] [own].
        timeout: age of the newest twist from which its velocity counts as zero [s]: whoever sent it may have died. Its
            height stays: a body that rises by itself would move hands that are at work.
        blend: time over which the targets go from one controller's to the next one's after a hand-over [s] [own: a
            jump of the targets in the middle of a step drives a light foot beyond its speed limit]; `off` blends
            nothing.
        gate_rate: how often gait clock and trim run at most [Hz]; controllers may be faster.
        trim: how the twist is corrected by the estimated velocity; `off` corrects nothing.
        foot_separation: how the feet are kept from crossing; `off` leaves that to the controller.
    """

    dead_band: float = 0.1
    minimum: float = 0.02
    acceleration: tuple[float, float, float] = (1.0, 1.0, 2.0)
    height_speed: float = 0.08
    timeout: float = 0.5
    blend: float | None = 0.15
    gate_rate: float = 100.0
    trim: VelocityIntegratorConfig | None = field(default_factory=VelocityIntegratorConfig)
    foot_separation: FootSeparationConfig | None = field(default_factory=FootSeparationConfig)

    def __post_init__(self) -> None:
        require(
            "locomotion option ",
            ("acceleration", min(self.acceleration), min(self.acceleration) > 0.0, "three positive numbers"),
            ("height_speed", self.height_speed, 0.0 < self.height_speed < math.inf, "a positive speed in m/s"),
            ("timeout", self.timeout, self.timeout > 0.0, "a positive time in seconds"),
            ("gate_rate", self.gate_rate, self.gate_rate > 0.0, "a positive rate in Hz"),
            ("minimum", self.minimum, 0.0 <= self.minimum <= self.dead_band, "from 0 to the dead band"),
        )


class Locomotion:
    """Runs one leg controller, or another one after a hand-over, under one twist and one gait clock.

    Attributes:
        commanded: the newest twist, as it came; zero for one that is not finite.
        applied: the twist the robot shall move at; the controller gets it with the trim's correction.
        height: the height it shall have now [m]; None is the controller's own.
        clamped: whether the commanded twist lies outside the controller's envelope.
        reason: why the controller does not get the commanded twist; empty where it does, slewing aside.
        motion: what the controller was asked for last.
        runs: how often the controller in charge was run.
    """

    def __init__(self, controller: LowerBody, config: LocomotionConfig | None = None) -> None:
        self.config = config or LocomotionConfig()
        self.gait = Gait(controller.gait)
        self._paced = RateDivider(controller)
        self._blend = CommandBlender(self.config.blend or 0.0)
        trim, separation = self.config.trim, self.config.foot_separation
        self._trim = None if trim is None else VelocityIntegrator(trim)
        self._separation = None if separation is None else FootSeparation(separation)
        self._rest = StopPredictor()
        self._gait_clock = GaitClock(self.gait, self._rest, self._trim)
        self._grounded = False
        self.motion, self.runs = STANDING, 0
        self._forget()

    @property
    def controller(self) -> LowerBody:
        """The controller in charge."""
        return self._paced.controller

    @property
    def moving(self) -> bool:
        """Whether the robot changes its place; see `LegStatus`."""
        return self._moves or (bool(self.gait.stepping) and self.gait.config.start != "always")

    @property
    def rest(self) -> PlanarPose:
        """Where the robot would come to rest; see `LegStatus`."""
        return self._rest.pose

    def reset(self, state: LowState) -> None:
        """Stand, from the measured `state` on; a twist from before is void."""
        self._forget()
        self._grounded = False
        self._rest.reset()
        self.gait.reset()
        self._blend.reset()
        self._paced.reset(state)

    def hand_over(self, controller: LowerBody, state: LowState, last: LegCommand | None) -> None:
        """Give the legs to `controller`, at zero twist; a step that was begun is finished.

        Whoever sends twists has to let go before one counts again: send one inside the dead band, or none for the
        timeout. They were for the controller that lost the legs.

        Args:
            controller: the controller that is in charge from now on.
            last: the last sound command, from which the targets lead over to those of `controller`.
        """
        self._forget()
        self._held, self._age = True, 0.0
        self._blend.begin(last)
        self._paced = RateDivider(controller)
        self._paced.reset(state)
        self.runs = 0

    def step(self, state: LowState, base: BaseEstimate, twist: Twist | None, dt: float) -> LegCommand:
        """Advance by one tick.

        Args:
            base: estimated pose and velocity of base_link.
            twist: a twist that was commanded since the previous tick, or None.
            dt: time since the previous tick [s], positive.
        """
        self._listen(twist, dt)
        self._grounded = self._grounded or not base.stale
        wanted = self._wanted()
        waits = wanted is not ZERO and not self._moves and not follows(self._paced.controller)
        if waits:
            self.reason = "who walks does not have the legs yet"
        if self._moves or (wanted is not ZERO and not waits):
            self._slew(ZERO if waits else wanted, dt)
        self._until_gate -= dt
        self._since_gate += dt
        if self._until_gate < 1e-6:
            self._clock(state, base, self._since_gate)
            self._until_gate += 1.0 / self.config.gate_rate
            if self._until_gate < 0.0:
                self._until_gate = 0.0
            self._since_gate = 0.0
        stepping = bool(self.gait.stepping)
        self._rise(waits, dt)
        motion = LocomotionCommand(self._trimmed, self.gait.phases, stepping, waits or self._moves, self.height)
        self.motion = motion
        command = self._paced.step(state, base, motion, dt)
        self.runs = self._paced.runs
        if self._blend.active:
            command = self._blend.step(command, dt)
        if self._separation is None or not stepping:
            return command
        return self._separation.step(command, state, (motion.phase >= self.gait.config.stance) & (base.contact < 0.5))

    def _forget(self) -> None:
        self.commanded = self.applied = self._trimmed = ZERO
        self._moves = False  # whether `applied` is anything else than zero
        self._asked: float | None = None  # the height of the newest twist
        self.height: float | None = None
        self._forget_trim()
        self.clamped = False
        self.reason = ""
        self._held, self._finite = False, True
        self._age = math.inf
        self._until_gate = self._since_gate = 0.0

    def _forget_trim(self) -> None:
        if self._trim is not None:
            self._trim.reset()

    def _listen(self, twist: Twist | None, dt: float) -> None:
        self._age += dt
        self._held = self._held and self._age <= self.config.timeout
        if twist is not None:
            self._finite = all(map(math.isfinite, _values(twist)))
            self.commanded, self._age = twist if self._finite else ZERO, 0.0
            self._asked = None if twist.height is None or math.isnan(twist.height) else twist.height
            self._held = self._held and not (self._finite and _size(twist) < self.config.dead_band)

    def _wanted(self) -> Twist:
        """Return the commanded twist as far as it can be followed; note why it cannot."""
        self.clamped = False
        asked = self.commanded
        if not self._finite:
            self.reason = "the commanded twist is not finite"
            return ZERO
        if asked is ZERO or not any(_values(asked)):
            self.reason = ""
            return ZERO
        if not self._grounded:
            self.reason = NO_FLOOR
            return ZERO
        if self._held:
            self.reason = "who commands has not let go since another controller took over"
            return ZERO
        if self._age > self.config.timeout:
            self.reason = f"no twist came for {self.config.timeout:g} s"
            return ZERO
        wanted = self.controller.envelope.clamp(asked)
        self.clamped = _values(wanted) != _values(asked)
        self.reason = "the commanded twist is outside the envelope" if self.clamped else ""
        size = _size(wanted)
        if size < (self.config.minimum if self._moves else self.config.dead_band):
            self.reason = self.reason or "the commanded twist is inside the dead band"
            return ZERO
        return wanted if size else ZERO

    def _rise(self, waits: bool, dt: float) -> None:
        """Bring the height towards the one that was asked for, or to the controller's own before another gets the legs.

        Note why it cannot, where nothing else is wrong.
        """
        asked, heights = self._asked, self._paced.controller.envelope.height
        if asked is None and self.height is None:
            return
        if heights is None or not self._grounded:
            self.height = None
            if asked is not None:
                why = "the legs take no height and keep their own" if heights is None else NO_FLOOR
                self.reason = self.reason or why
            return
        low, own, high = heights
        goal = own if asked is None or waits else min(max(asked, low), high)
        if asked is not None and not low <= asked <= high:
            self.reason = self.reason or f"the commanded height is outside of {low:g} to {high:g} m"
        self.height = _toward(own if self.height is None else self.height, goal, self.config.height_speed * dt)
        if self.height == own and (asked is None or waits):
            self.height = None

    def _slew(self, wanted: Twist, dt: float) -> None:
        """Bring the applied twist towards `wanted`; on its way to a stop it ends at the dead band."""
        now, (ax, ay, aw) = self.applied, self.config.acceleration
        vx = _toward(now.vx, wanted.vx, ax * dt)
        vy = _toward(now.vy, wanted.vy, ay * dt)
        wz = _toward(now.wz, wanted.wz, aw * dt)
        stopped = wanted is ZERO and math.hypot(vx, vy, wz) < self.config.dead_band
        self.applied = ZERO if stopped else Twist(vx, vy, wz)
        self._moves = bool(self.applied.vx or self.applied.vy or self.applied.wz)

    def _clock(self, state: LowState, base: BaseEstimate, dt: float) -> None:
        """Advance the gait clock by `dt` [s] from how well the measured robot stands."""
        controller = self._paced.controller
        if self.gait.config is not controller.gait:
            if self.gait.config != controller.gait:
                # Another controller has the legs, as in a hand-over: what was learned about the last one is void.
                self._forget_trim()
            self.gait.use(controller.gait)
        trimmed = self._gait_clock.step(state, base, self.applied, dt)
        if not self._moves and not self.gait.stepping:
            self._trimmed = ZERO
        else:
            choices = zip(controller.envelope.axes, trimmed.tolist(), _values(self.applied), strict=True)
            self._trimmed = Twist(*[new if own else old for own, new, old in choices])


def _toward(x: float, goal: float, step: float) -> float:
    return x + min(max(goal - x, -step), step)


def _values(twist: Twist) -> tuple[float, float, float]:
    return twist.vx, twist.vy, twist.wz


def _size(twist: Twist) -> float:
    return math.hypot(twist.vx, twist.vy, twist.wz)
