"""Walks with one controller and stands with another, as the paper does: the vendor's walks, ALMI stands.

The legs change hands while the robot stays in place and is healthy, and the targets are blended over a short time,
because each controller has its own posture and gains. Meanwhile both balance the robot. A controller that has to start
first, such as the vendor's, gets the legs once it has started. Until then the robot stands: the standing controller
steps to keep its balance, not because a twist was commanded that it cannot follow.

A robot that is shoved while it walks may be caught by the standing controller, which steps wherever the balance asks
for, not where the command points. Once it is in place again, it walks on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

from golem import registry
from golem.capabilities.legs.base import ZERO, Envelope, LocomotionCommand, LowerBody, Starting, follows
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.rate_divider import RateDivider
from golem.capabilities.legs.vendor import Onboard
from golem.interfaces.payloads import LegCommand
from golem.types import LEGS, Array, BaseEstimate, LowState


class CommandBlender:
    """Mixes the commands of the controller that was in charge with those of the one that is, while it is `active`."""

    def __init__(self, duration: float) -> None:
        """Take `duration` [s] from one controller to the next, unless `begin` says otherwise."""
        self._usual = self._duration = duration
        self.reset()

    def reset(self) -> None:
        """Let the next command pass as it is."""
        self.begin(None)

    def begin(self, old: LegCommand | None, duration: float | None = None) -> None:
        """Lead over from the command `old` to those of another controller; None lets them pass as they are."""
        self._old, self._elapsed = old, 0.0
        self.active = old is not None
        self._duration = self._usual if duration is None else duration

    def step(self, command: LegCommand, dt: float, old: LegCommand | None = None) -> LegCommand:
        """Return what the legs are told `dt` [s] after the previous tick instead of `command`.

        Args:
            dt: time since the previous tick [s].
            old: what the one before says now, if it goes on; else the command given to `begin` stays.
        """
        self._elapsed += dt
        if self._old is None or self._elapsed >= self._duration:
            self._old, self.active = None, False
            return command
        return _mixed(old or self._old, command, self._elapsed / self._duration)


def _mixed(old: LegCommand, new: LegCommand, share: float) -> LegCommand:
    """Return the command that is `share` of the way from `old` to `new`."""

    def mix(a: Array, b: Array) -> Array:
        return a + share * (b - a)

    # Without a torque of their own the servo carries the legs; there is nothing in between.
    tau = new.tau if old.tau is None or new.tau is None else mix(old.tau, new.tau)
    return LegCommand(mix(old.q, new.q), mix(old.kp, new.kp), mix(old.kd, new.kd), tau)


@dataclass(frozen=True, slots=True)
class HandoverPart:
    """One of the two controllers.

    Attributes:
        use: its name, as in the slot `lower_body`.
        options: its options.
    """

    use: str
    options: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, slots=True)
class HandoverConfig:
    """Options of `Handover`. The gate's figures are those of correlllab/HAMS, whose robot changes policies with them.

    Attributes:
        walk, stand: the controller that follows twists, and the one in charge while there is none.
        gyro: angular rate of the torso below which the robot is healthy [rad/s].
        joint_speed: the same for each leg joint [rad/s].
        lean: the same for the horizontal part of the unit vector of gravity, in the torso's frame.
        speed: the same for the horizontal velocity of the base [m/s] [own].
        calm: healthy time before the legs change hands [s]: five ticks of 50 Hz.
        blend: time over which targets and gains go from one controller's to the other's [s] [own: over 0.3 s, from a
            command that stayed as it was, the shipped legs rocked when they stopped, and a light foot turned by 10
            degrees].
        shoved: deviation of the base's horizontal velocity from the twist beyond which the standing controller catches
            a robot that walks [m/s]; None never does.
        catch: time over which the targets go over then [s] [own].
    """

    walk: HandoverPart
    stand: HandoverPart
    gyro: float = 1.0
    joint_speed: float = 6.0
    lean: float = 0.25
    speed: float = 0.2
    calm: float = 0.1
    blend: float = 0.8
    shoved: float | None = None
    catch: float = 0.1


class Handover:
    """Two controllers that take turns; see `LowerBody`.

    Attributes:
        rate, latency: the higher of the two controllers' rates; each runs at its own. The longer latency.
        envelope: that of the walking controller, with the heights of the one in charge. Another than its own is for a
            robot that stands: the legs change hands at the standing one's own height.
        gait: the clock that the controller in charge wants; while it stands, without a start at a command.
        walking: whether the walking controller is in charge.
    """

    def __init__(self, config: HandoverConfig, onboard: Onboard | None = None) -> None:
        """Make both controllers; `onboard` is for one that speaks to the robot's own computer.

        Raises ConfigError, ModuleFault: one of them cannot be made; see `registry.create`.
        """
        self.config = config
        parts = (config.walk, config.stand)
        both = [registry.create("lower_body", p.use, p.options, onboard=onboard) for p in parts]
        self._walk, self._stand = (RateDivider(controller) for controller in both)
        self.rate: float = max(controller.rate for controller in both)
        self.latency: float = max(controller.latency for controller in both)
        self._envelopes = tuple(replace(both[0].envelope, height=one.envelope.height) for one in both)
        self._blend = CommandBlender(config.blend)
        # False for what is not a number.
        self._gyro_below, self._speed_below = float(config.gyro).__gt__, float(config.joint_speed).__gt__
        self._begin()

    @property
    def follows(self) -> bool:
        """Whether twists are followed now; see `Following`."""
        return self.walking and follows(self._walk.controller)

    def reset(self, state: LowState) -> None:
        """Stand, from the measured `state` on; a robot that is found walking is first brought to a stop."""
        self._begin()
        self._active.reset(state)

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        self._healthy = self._healthy + dt if self._is_healthy(state, base) else 0.0
        if self.walking and self._is_shoved(base, motion):
            self._catch(state)
        # Another controller failed while it walked: the walking one ends that, if it is ready.
        found = self._last is None and motion.stepping and not self._is_in_place(base)
        wanted = found or self._other_wanted(motion)
        may_change = wanted and (found or (self._healthy > self.config.calm - 0.5 * dt and not self._blend.active))
        if not wanted:
            self._coming = None
        elif self._coming is None and may_change:
            self._coming = self._stand if self.walking else self._walk
            self._coming.reset(state)
        command = None if self._coming is None else self._coming.step(state, base, motion, dt)
        if self._coming is not None and command is not None and may_change and _is_ready(self._coming.controller):
            self._leaving = self._active
            self._take_over(self._coming)
            self._blend.begin(self._last)
        else:
            still = motion.twist is ZERO and not motion.commanded
            asked = motion if self.walking or still else _standing(motion)
            command = self._active.step(state, base, asked, dt)
        if self._blend.active:
            command = self._blend.step(command, dt, self._leaving.step(state, base, _standing(motion), dt))
        if self._active.controller.gait is not self._own_gait:  # its legs changed hands, too
            self._read_gait()
        self._last = command
        return command

    def _catch(self, state: LowState) -> None:
        """Give the legs to the standing controller in the middle of a step."""
        self._stand.reset(state)
        self._leaving = self._active
        self._take_over(self._stand)
        self._blend.begin(self._last, self.config.catch)

    def _take_over(self, controller: RateDivider) -> None:
        self._active = controller
        self.walking = controller is self._walk
        self.envelope: Envelope = self._envelopes[not self.walking]
        self._read_gait()
        self._coming: RateDivider | None = None

    def _read_gait(self) -> None:
        self._own_gait: GaitConfig = self._active.controller.gait
        self.gait: GaitConfig = self._own_gait if self.walking else self._own_gait.without_commands()

    def _begin(self) -> None:
        self._take_over(self._stand)
        self._leaving = self._active
        self._healthy = 0.0
        self._last: LegCommand | None = None
        self._blend.reset()

    def _is_shoved(self, base: BaseEstimate, motion: LocomotionCommand) -> bool:
        """Return whether the robot, which walks, does so far from as it was told."""
        bound = self.config.shoved
        if bound is None or self._blend.active or self._last is None or base.stale:
            return False
        x, y = base.T_odom_base[0, 0], base.T_odom_base[1, 0]
        vx, vy, size = base.velocity[0], base.velocity[1], math.hypot(x, y)
        ahead, sideways = (x * vx + y * vy) / size, (x * vy - y * vx) / size
        return math.hypot(ahead - motion.twist.vx, sideways - motion.twist.vy) > bound

    def _is_in_place(self, base: BaseEstimate) -> bool:
        return math.hypot(base.velocity[0], base.velocity[1]) < self.config.speed

    def _is_healthy(self, state: LowState, base: BaseEstimate) -> bool:
        """Return whether the measured robot is calm, upright, in place, and not on one leg."""
        w, x, y, z = state.imu.quat.tolist()
        # Gravity in the torso's frame is minus the last row of its rotation.
        lean = math.hypot(2.0 * (x * z - w * y), 2.0 * (y * z + w * x))
        left, right = base.contact.tolist()
        return (
            all(map(self._gyro_below, map(abs, state.imu.gyro.tolist())))
            and all(map(self._speed_below, map(abs, state.dq[LEGS].tolist())))
            and lean < self.config.lean
            and self._is_in_place(base)
            and (left > 0.5) == (right > 0.5)
        )

    def _other_wanted(self, motion: LocomotionCommand) -> bool:
        """Return whether `motion` is for the controller that is not in charge.

        A twist is for the walking one. Without a twist it goes on until the clock has stopped; if its clock never does,
        until both feet are down.
        """
        if motion.commanded:
            return not self.walking and motion.height is None
        if not self.walking:
            return False
        if not motion.stepping:
            return True
        return self.gait.start == "always" and bool((motion.phase < self.gait.stance).all())


def _standing(motion: LocomotionCommand) -> LocomotionCommand:
    return LocomotionCommand(ZERO, motion.phase, motion.stepping, False, motion.height)


def _is_ready(controller: LowerBody) -> bool:
    return not isinstance(controller, Starting) or controller.started
