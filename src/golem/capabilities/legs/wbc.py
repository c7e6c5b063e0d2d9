"""Stands on both feet by whole-body control: one quadratic program per tick.

From the measured state alone follow four wishes, each a spring and a damper in acceleration: the centre of mass above
the middle of the soles with the pelvis at the stance's height, an upright pelvis that faces where the feet point, soles
that neither move nor creep, and the stance's posture. `wbc_qp.StanceProgram` finds the contact forces and the motor
torques that come closest. There is no plan, no integral and no stepping: once the capture point has left the soles, it
leans against the fall as hard as friction and motors allow.

A robot in a hoist has nothing to push against with its whole weight. Feet that are found loaded get the torques at
once; those that are not get them little by little, beside a posture hold that fades, and only half of them until the
ground is felt. Once they have all of it, they keep it until the next reset.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from golem.capabilities.legs.base import LocomotionCommand
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.hold import STANCES, height_of, squat, standing
from golem.capabilities.legs.wbc_qp import NUM_LEGS, QpWeights, Solution, StanceDynamics, StanceProgram, Tasks
from golem.errors import ConfigError, GolemError, unknown_name
from golem.interfaces.payloads import LegCommand
from golem.robots.model.imu_mount import sensed_base_rate
from golem.robots.model.table import load_limits
from golem.types import LEGS, Array, BaseEstimate, LowState

_SLIP = np.array([0.003, 0.003, 0.02])
"""How far the feet may be from their places relative to each other, x, y [m] and yaw [rad]; further on these move."""


class StanceError(GolemError):
    """The stance controller has nothing sound to command."""


@dataclass(frozen=True, slots=True)
class WbcConfig:
    """Options of `Wbc`.

    Attributes:
        stance: posture to stand in, a name in `hold.STANCES`.
        height_speed: how fast the pelvis moves from where it is found to the stance's height [m/s]; a commanded height
            comes at the base layer's rate.
        heights: lowest and highest height that is taken [m]; `off` takes none.
        com_gain, com_damping: spring [1/s^2] and damper [1/s] of the centre of mass along x, y and z. The vertical ones
            are stiffer: what the hands carry is not in the model and pulls straight down.
        turn_gain, turn_damping: the same of the pelvis' orientation.
        posture_gain, posture_damping: the same of the leg joints.
        feet_gain: spring of the soles' places relative to each other [1/s^2], and
        feet_damping: damper of the soles [1/s]. Feet that stand creep otherwise: encoder errors become forces that
            press them together, and no measurement but their distance tells.
        kp: stiffness of the posture hold before the feet are loaded: hip yaw, pitch, roll, knee, ankle pitch, roll
            [N m/rad]; those of `HoldConfig`.
        kd: damping of the same motors [N m s/rad]. With loaded feet the feed-forward cancels it at the measured speed,
            so that it only acts on what happens between two ticks.
        friction: coefficient the feet may rely on; the soles have 0.8, and the inscribed pyramid keeps less.
        sole_margin: how far the centre of pressure stays inside the edge of a sole [m].
        torque_profile: a profile of `robots.model.table`.
        torque_ratio: share of those limits that is used. 0.85 is just below what the safety gate lets through.
        weights: of the tasks.
        engage: time in which feet that were not loaded get their torques [s].
        patience: ticks in a row without a solution for which the last one is kept.
        hands: whether the robot wears the MAGPIE hands.
        speed_lag: time constant of a low pass on the joints' speeds [s]; rotors jump in the play of their gears.
        rate: ticks per second [Hz].
    """

    stance: str = "crouch"
    height_speed: float = 0.1
    heights: tuple[float, float] | None = (0.78, 1.01)
    com_gain: tuple[float, float, float] = (40.0, 40.0, 100.0)
    com_damping: tuple[float, float, float] = (12.0, 12.0, 20.0)
    turn_gain: float = 100.0
    turn_damping: float = 20.0
    posture_gain: float = 50.0
    posture_damping: float = 14.0
    feet_gain: float = 2500.0
    feet_damping: float = 50.0
    kp: tuple[float, ...] = (200.0, 200.0, 200.0, 300.0, 40.0, 40.0)
    kd: tuple[float, ...] = (2.0, 2.0, 2.0, 2.0, 1.0, 1.0)
    friction: float = 0.6
    sole_margin: float = 0.005
    torque_profile: str = "urdf"
    torque_ratio: float = 0.85
    weights: QpWeights = QpWeights()
    engage: float = 1.0
    patience: int = 5
    hands: bool = True
    speed_lag: float = 0.01
    rate: float = 500.0


class Wbc:
    """The stance controller; it ignores the twist, and its envelope has heights only."""

    def __init__(self, config: WbcConfig | None = None) -> None:
        """Build the program. Raises ConfigError: unknown stance or torque profile, not six values of kp and of kd."""
        self.config = c = config or WbcConfig()
        if c.stance not in STANCES:
            raise unknown_name("stance", c.stance, STANCES)
        if len(c.kp) != NUM_LEGS // 2 or len(c.kd) != NUM_LEGS // 2:
            raise ConfigError("Wbc needs six values of kp and of kd: hip yaw, pitch, roll, knee, ankle pitch, roll.")
        self.rate = c.rate
        self.latency = 0.0
        self.gait = GaitConfig(start="never")
        self._rest: Array = np.tile(np.asarray(STANCES[c.stance]), 2)
        self._rest_height = height_of(self._rest)
        self.envelope = standing(self._rest_height, c.heights)
        self._kp, self._kd = np.tile(c.kp, 2), np.tile(c.kd, 2)
        self._bound: Array = c.torque_ratio * load_limits(c.torque_profile).torque[LEGS]
        self._com_gain, self._com_damping = np.array(c.com_gain), np.array(c.com_damping)
        self._dynamics = StanceDynamics(c.hands)
        self._program = StanceProgram(self._bound, c.friction, c.sole_margin, c.weights)
        self._hold: Array | None = None
        self._apart: Array | None = None
        self._height = 0.0
        self._share = 0.0
        self._solution: Solution | None = None
        self._failures = 0
        self._speed: Array | None = None

    def reset(self, state: LowState) -> None:
        """Forget everything; the next tick takes posture, height and load of the feet from its measurements."""
        self._hold = self._apart = self._solution = self._speed = None
        self._failures = 0

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        """Solve for this tick's torques. Raises StanceError: a measurement is not finite, or no solution for long."""
        c, d = self.config, self._dynamics
        q = state.q[LEGS]
        rate = sensed_base_rate(state)
        if not math.isfinite(sum(float(x.sum()) for x in (state.q, state.dq, rate, base.velocity))):
            raise StanceError("Wbc was given a joint, a rate or a base velocity that is not finite.")
        R = base.T_odom_base[:3, :3]
        before = state.dq if self._speed is None else self._speed
        self._speed = speed = before + dt / (c.speed_lag + dt) * (state.dq - before)
        d.update(R, base.velocity, rate, state.q, speed)
        middle = d.soles.mean(axis=0)
        wish, rest = self._rest_height, self._rest
        if motion.height is not None:
            wish, rest = motion.height, squat(motion.height)
        hold = self._advance(q, -float(middle[2]), wish, float(base.contact.sum()), dt)
        level, goal = self._goal(middle)
        tasks = Tasks(
            com=self._com_gain * (goal - d.com) - self._com_damping * d.com_velocity,
            turn=c.turn_gain * pin.log3(R.T @ level) - c.turn_damping * rate,
            feet=c.feet_gain * self._creep(level) - c.feet_damping * d.soles_velocity,
            legs=c.posture_gain * (rest - q) - c.posture_damping * speed[LEGS],
        )
        solution = self._program.solve(d, tasks)
        self._failures = self._failures + 1 if solution is None else 0
        self._solution = solution or self._solution
        if self._solution is None or self._failures > c.patience:
            raise StanceError(f"Wbc found no contact forces for {self._failures} ticks in a row.")
        tau = self._share * (self._solution.torque + self._kd * speed[LEGS])
        return LegCommand(hold.copy(), (1.0 - self._share) * self._kp, self._kd.copy(), tau)

    def _goal(self, middle: Array) -> tuple[Array, Array]:
        """Return the rotation that base_link shall have, and where the centre of mass belongs."""
        d = self._dynamics
        ahead = d.soles_R[0, :2, 0] + d.soles_R[1, :2, 0]
        c, s = (ahead / np.linalg.norm(ahead)).tolist()
        level = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        # The pelvis' height stands in for the CoM's, so that raising an arm bends no knee.
        return level, middle + np.array([0.0, 0.0, self._height + d.com[2]])

    def _creep(self, level: Array) -> Array:
        """Return the (12,) way back of both soles to their places relative to each other, in their own axes."""
        d = self._dynamics
        turn = math.atan2(*(d.soles_R[1, :2, :2].T @ d.soles_R[0, :2, 0])[::-1])
        apart = np.append((level.T @ (d.soles[0] - d.soles[1]))[:2], turn)
        if self._apart is None or self._share < 1.0:
            self._apart = apart
        error = np.minimum(np.maximum(self._apart - apart, -_SLIP), _SLIP)
        self._apart = apart + error
        back = 0.5 * (level[:, :2] @ error[:2])
        out = np.zeros(12)
        out[:3], out[6:9] = d.soles_R[0].T @ back, -(d.soles_R[1].T @ back)
        out[5], out[11] = 0.5 * error[2], -0.5 * error[2]
        return out

    def _advance(self, q: Array, height: float, wish: float, contact: float, dt: float) -> Array:
        """Move the wished height to `wish` [m], and the share of the torques to 1; return the posture to hold.

        The pelvis is at `height` above the soles [m]; `contact` is the probability of one, both feet summed.
        """
        loaded = contact > 0.5
        if self._hold is None:
            self._hold, self._height, self._share = q.copy(), height, float(loaded)
        reach = self.config.height_speed * dt
        self._height += min(max(wish - self._height, -reach), reach)
        self._share = min(self._share + dt / self.config.engage, 1.0 if loaded else max(self._share, 0.5))
        return self._hold
