"""What the legs are rewarded for: ALMI's terms (ALMI-Open, BSD-3) with sharper tracking and an explicit quiet stand.

Velocities are judged by a running mean over about half a gait period: a walking body sways, and a reward on the
instantaneous velocity pays for suppressing the sway instead of for arriving.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.legs.gait import Gait, GaitConfig, rise, swing_share
from golem.hardware.safety.base import SafetyLimits
from golem.training.legs.batch_world import BatchTruth, Rows
from golem.training.legs.training_model import FEET_APART, STANCE, STAND_HEIGHT
from golem.types import GRAVITY, LEGS, Array

_YAW = np.array([0, 6])
_YAW_ROLL = np.array([0, 2, 6, 8])
_ANKLES = np.array([4, 5, 10, 11])
_PENDULUM = float(np.sqrt(STAND_HEIGHT / GRAVITY))
"""Time constant of the robot as an inverted pendulum [s]: velocity times this is how far the capture point is ahead."""
LOW = 0.02
"""Height of a sole that is about to land, or has just lifted off [m]."""


@dataclass(frozen=True)
class RewardWeights:
    """Weight of each term, per second; positive rewards, negative punishes.

    Attributes:
        linear, angular: mean velocity as commanded, exp(-error^2 / 0.03).
        linear_now, angular_now: present velocity as commanded, exp(-error^2 / 0.25).
        alive: not fallen.
        contact: feet on the ground in their stance, and off it in the middle two thirds of their swing. With 0.4, and
            0.4 of `slip`, the robot dragged the trailing foot, with 100 to 200 N on it, when it walked sideways.
        dragged: feet on the ground in the middle two thirds of their swing. It is paid where the sum is negative, too,
            as `fast`: else a robot that keeps both feet down after a push loses nothing by it.
        placement: in the second half of a swing, the foot above where the capture point says that it belongs,
            exp(-error^2 / 0.12^2), after a push; see `placement`.
        swing_height: error of the height of a swinging sole [m^2].
        flat: tilt of the soles to the ground, 1 - cos. A foot that lands on an edge slaps down faster than the gate
            allows, and one that rolls over its heel under load misleads the odometry: when that was not punished, the
            robot marked time on its heels, and the odometry lost 10 mm in a second.
        upright: horizontal part of gravity in base_link, squared.
        height: error of the base's height above the soles [m^2].
        bounce: vertical velocity squared.
        rock: roll and pitch rates squared.
        torque, ankle_torque, acceleration, speed: squared, of the leg joints.
        smooth: change of the action squared.
        limits: how far joints are beyond 90 % of their range [rad].
        fast: how much faster a joint is than 70 % of what stops the robot [rad/s]; see `Rewards`.
        hips: yaw and roll of the hips squared [rad^2].
        toes: yaw of the hips squared [rad^2]: with the toes 10 degrees out, each foot turned on the ground when the
            standing network took over, and the robot with them.
        turned: yaw of the feet relative to the pelvis squared [rad^2]: it turns when the robot stops.
        slip: velocity of loaded soles squared.
        landing: velocity of free soles less than `LOW` above the ground squared: who comes down fast slides and slaps.
        feet: misplacement of the feet, beyond 2 cm and the step that the command takes, while both are on the ground
            [m]: the clock stops below 5 cm only. With 4 beyond 4 cm they were up to 9 cm too close together.
        impact: foot force above 800 N [N].
        center: mean capture point, less the way to it at the commanded velocity, over the middle of the feet,
            exp(-error^2 / 0.04^2), stepping: who marks time on the heels lands 5 cm ahead where it stops.
        stand_posture: deviation from the stance squared, standing.
        stand_still: base velocity squared, standing.
        stand_calm: base velocity, exp(-velocity^2 / 0.03^2), standing: the square says nothing about a sway of 3 mm at
            2 Hz, into which legs of high gain fall at 20 ms of delay.
        stand_upright: as `upright`, standing: without it the trunk leans to bring its weight over the soles.
        stand_square: the pelvis square to the feet, exp(-yaw^2 / 0.02^2), standing: else it turns slowly above them.
        stand_center, stand_exact: capture point over the middle of the feet, exp(-error^2 / w^2), standing; w is 3 cm,
            and 1.2 cm: what is off by little shall come back as quickly, and encoder zeros alone put it off by 1 cm.
        stand_step: the gait clock runs although no velocity is commanded.
    """

    linear: float = 2.0
    angular: float = 1.6
    linear_now: float = 0.8
    angular_now: float = 0.3
    alive: float = 0.5
    contact: float = 1.0
    dragged: float = -1.5
    placement: float = 1.5
    swing_height: float = -60.0
    flat: float = -50.0
    upright: float = -20.0
    height: float = -40.0
    bounce: float = -1.0
    rock: float = -0.15
    torque: float = -1e-5
    ankle_torque: float = -5e-5
    acceleration: float = -1.5e-7
    speed: float = -1e-3
    smooth: float = -0.015
    limits: float = -5.0
    fast: float = -2.0
    hips: float = -2.0
    toes: float = -8.0
    turned: float = -20.0
    slip: float = -1.5
    landing: float = -2.0
    feet: float = -60.0
    impact: float = -0.002
    center: float = 0.5
    stand_posture: float = -2.0
    stand_still: float = -2.0
    stand_calm: float = 0.6
    stand_upright: float = -40.0
    stand_square: float = 0.4
    stand_center: float = 0.5
    stand_exact: float = 0.4
    stand_step: float = -0.6


class Rewards:
    """Rewards of `n` robots, with the running means they need.

    A negative sum counts as zero: it would teach the beginner to fall early. In the second after a hard push it is
    negative all the time, and so legs that had learned with nothing else stepped as fast as they could: 123 of 125 lost
    shoves were stops by the gate. There `fast` has its price, too, once the robot has learned to step: with that price
    from the start it never stepped sideways.

    For a while after a push the command need not be followed: its rewards are paid in full, whatever the velocity. So
    the sum stays positive while the robot recovers, and how it moves its feet counts then as well.
    """

    def __init__(
        self, n: int, weights: RewardWeights, gait: GaitConfig, clearance: float, limits: SafetyLimits
    ) -> None:
        """Begin at rest; soles are to swing `clearance` [m] high, and `limits` are the safety gate's."""
        self._clearance = clearance
        self._limits = limits
        self._lower, self._upper = limits.lower[LEGS], limits.upper[LEGS]
        self._weights = weights
        self._share = gait.period / 2.0
        self._mean: Array = np.zeros((n, 3))
        self._ahead: Array = np.zeros((n, 2))
        self._speed: Array = np.zeros((n, 12))

    def reset(self, where: Rows) -> None:
        """Put the robots `where` at rest."""
        self._mean[where] = 0.0
        self._ahead[where] = 0.0
        self._speed[where] = 0.0

    def tracked_error(self, twist: Array) -> Array:
        """Return (n, 3): the mean velocity less the command, vx, vy [m/s], wz [rad/s]."""
        return self._mean - twist

    def __call__(
        self,
        truth: BatchTruth,
        twist: Array,
        gait: Gait,
        action: Array,
        last: Array,
        capture: Array,
        misplaced: Array,
        landing: Array,
        recovers: NDArray[np.bool_],
        strictness: float,
        dt: float,
    ) -> tuple[Array, dict[str, float]]:
        """Return the reward (n,) of one period and the mean of each term.

        Args:
            truth: after the period.
            twist: (n, 3) command [m/s, m/s, rad/s].
            action: (n, 12) of this period.
            last: (n, 12) of the one before.
            capture: (n, 2) capture point from the middle of the feet, heading frame [m].
            misplaced: (n,) distance of the feet from where they belong [m].
            landing: (n, 2) distance of each foot from where it belongs when it lands [m].
            recovers: (n,) whether a push was so recent that the command need not be followed.
            strictness: share of the price of `fast` and `dragged` that is paid where the sum is negative, 0 to 1.
            dt: the period [s].
        """
        w = self._weights
        now = truth.heading_velocity()
        share = dt / (self._share + dt)
        self._mean += (now - self._mean) * share
        self._ahead += (capture - twist[:, :2] * _PENDULUM - self._ahead) * share
        obeys = ~recovers[:, None]
        mean = np.square(self._mean - twist) * obeys
        error = np.square(now - twist) * obeys
        phase, stepping = gait.phases, gait.stepping
        stance = ~stepping[:, None] | (phase < gait.config.stance)
        speed_of_feet = np.hypot(twist[:, 0], twist[:, 1]) + 0.5 * FEET_APART[1] * np.abs(twist[:, 2])
        step = 0.5 * gait.config.period * speed_of_feet
        loaded = truth.force > 5.0
        swing = swing_share(phase, gait.config.stance)
        lifted = rise(swing)
        near = np.exp(-np.square(landing / 0.12)) * (~stance & (swing > 0.5))
        high = self._clearance * lifted - truth.clearance
        legs, speed = truth.q[:, LEGS], truth.dq[:, LEGS]
        torque = np.square(truth.torque[:, LEGS])
        level = truth.height - truth.clearance.min(axis=1)
        beyond = np.maximum(legs - self._upper, 0.0) + np.maximum(self._lower - legs, 0.0)
        still = (np.abs(twist).max(axis=1) < 1e-6).astype(np.float64)
        rest = still * ~stepping
        lean = np.square(truth.R[:, 2, :2]).sum(axis=1)
        turned = 0.5 * (legs[:, 0] + legs[:, 6])
        off = np.square(capture).sum(axis=1)
        moving = np.square(truth.sole_velocity).sum(axis=2)
        drift = np.square(truth.velocity[:, :2]).sum(axis=1)
        terms: dict[str, Array] = {
            "linear": np.exp(-(mean[:, 0] + mean[:, 1]) / 0.03),
            "angular": np.exp(-mean[:, 2] / 0.03),
            "linear_now": np.exp(-(error[:, 0] + error[:, 1]) / 0.25),
            "angular_now": np.exp(-error[:, 2] / 0.25),
            "alive": np.ones(len(twist)),
            "contact": np.where(stance, loaded, ~loaded | (lifted < 0.25)).mean(axis=1),
            "dragged": (~stance & loaded & (lifted >= 0.25)).mean(axis=1),
            "placement": near.sum(axis=1) * recovers,
            "swing_height": (np.square(high) * ~stance).sum(axis=1),
            "flat": (1.0 - truth.sole_up).sum(axis=1),
            "upright": lean,
            "height": np.square(level - STAND_HEIGHT),
            "bounce": np.square(truth.velocity[:, 2]),
            "rock": np.square(truth.rate[:, :2]).sum(axis=1),
            "torque": torque.sum(axis=1),
            "ankle_torque": torque[:, _ANKLES].sum(axis=1),
            "acceleration": np.square((speed - self._speed) / dt).sum(axis=1),
            "speed": np.square(speed).sum(axis=1),
            "smooth": np.square(action - last).sum(axis=1),
            "limits": beyond.sum(axis=1),
            "fast": np.maximum(np.abs(speed) - 0.7 * self._limits.velocity[LEGS], 0.0).sum(axis=1),
            "hips": np.square(legs[:, _YAW_ROLL]).sum(axis=1),
            "toes": np.square(legs[:, _YAW]).sum(axis=1),
            "turned": np.square(turned),
            "slip": (moving * loaded).sum(axis=1),
            "landing": (moving * (~loaded & (truth.clearance < LOW))).sum(axis=1),
            "feet": np.maximum(misplaced - 0.02 - step, 0.0) * stance.all(axis=1),
            "impact": np.maximum(truth.force - 800.0, 0.0).sum(axis=1),
            "center": np.exp(-np.square(self._ahead).sum(axis=1) / 0.04**2) * stepping,
            "stand_posture": np.square(legs - STANCE).sum(axis=1) * rest,
            "stand_still": (drift + np.square(now[:, 2])) * rest,
            "stand_calm": np.exp(-drift / 0.03**2) * rest,
            "stand_upright": lean * rest,
            "stand_square": np.exp(-np.square(turned / 0.02)) * rest,
            "stand_center": np.exp(-off / 0.03**2) * rest,
            "stand_exact": np.exp(-off / 0.012**2) * rest,
            "stand_step": still * stepping,
        }
        self._speed = speed.copy()
        weighted = {name: getattr(w, name) * value for name, value in terms.items()}
        always = strictness * (weighted["fast"] + weighted["dragged"])
        total = np.asarray(sum(weighted.values()), dtype=np.float64) - always
        return (np.maximum(total, 0.0) + always) * dt, {n: float(v[np.isfinite(v)].mean()) for n, v in weighted.items()}
