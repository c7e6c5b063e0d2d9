"""What the gait clock does, written once more in plain NumPy, for one robot."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from golem.capabilities.legs.balance_errors import VelocityIntegratorConfig
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.gait_clock import LOADED, SMOOTHING, STOOD
from golem.robots.model.imu_mount import sensed_base_rate
from golem.robots.model.leg_kinematics import SOLE_CENTER
from golem.robots.model.pinocchio_model import Kinematics, build
from golem.types import GRAVITY, SIDES, Array, BaseEstimate, LowState, PlanarPose

STILL = PlanarPose(0.0, 0.0, 0.0)


class ClockTwin:
    """Gait, place of rest and trim of one robot.

    Attributes:
        phase, stepping, rest, errors: what the last step found; capture point and misplacement.
    """

    def __init__(self, gait: GaitConfig, trim: VelocityIntegratorConfig | None) -> None:
        self.gait, self.trim = gait, trim
        self.kinematics, self.model = Kinematics(), build()
        self.data = self.model.createData()
        left, right = self._feet(np.zeros(27))[:, :2, 3]
        self.stance: Array = left - right
        self.phase, self.stepping, self.idle = 0.0, False, 0.0
        self.rest, self.prints, self.samples = STILL, [STILL, STILL], [0, 0]
        self.above: PlanarPose | None = None
        self.stood = 0.0
        self.surplus, self.correction = np.zeros(3), np.zeros(3)

    def _feet(self, q: Array) -> Array:
        self.kinematics.update(q)
        sole = np.eye(4)
        sole[:3, 3] = SOLE_CENTER
        return np.array([self.kinematics.pose(f"{side}_ankle_roll_link") @ sole for side in SIDES])

    def step(self, state: LowState, base: BaseEstimate, twist: Array, dt: float) -> Array:
        """Advance by `dt` and return the corrected twist."""
        R = base.T_odom_base[:3, :3]
        com: Array = R @ pin.centerOfMass(self.model, self.data, state.q)
        feet = self._feet(state.q)
        rate = R @ sensed_base_rate(state)
        capture, misplaced = stand_errors(
            R, com, base.velocity + np.cross(rate, com), feet[:, :3, 3] @ R.T, self.stance
        )
        self.errors = np.array([*capture, misplaced])
        self.step_gait(bool(twist.any()), capture, misplaced, dt)
        moving = bool(twist.any()) or (self.stepping and self.gait.start != "always")
        self.step_rest(base.T_odom_base, feet, base.contact, moving, dt)
        if not (twist.any() or self.stepping):
            self.surplus, self.correction = np.zeros(3), np.zeros(3)
            return np.zeros(3)
        if self.trim is None:
            return twist
        measured = np.append(heading_matrix(R).T @ base.velocity[:2], rate[2])
        self.surplus = self.surplus + (twist - measured - self.surplus) * (dt / (self.trim.smoothing + dt))
        change = self.trim.gain * dt * np.clip(self.surplus, -np.array(self.trim.heed), self.trim.heed)
        self.correction = np.clip(self.correction + change, -np.array(self.trim.maximum), self.trim.maximum)
        return twist + self.correction

    def step_gait(self, commanded: bool, capture: Array, misplaced: float, dt: float) -> None:
        """Advance the clock alone."""
        config = self.gait
        lost = bool(np.hypot(*(capture / config.capture_start)) > 1.0) or misplaced > config.feet_start
        lost, commanded = lost and config.recovers, commanded and config.follows
        wanted = config.start == "always" or commanded or lost
        begins = wanted and not self.stepping
        if begins:
            self.phase = (0.0 if capture[1] >= 0.0 else 0.5) + (config.stance - 0.5 if lost and not commanded else 0.0)
        self.idle = 0.0 if wanted else self.idle + dt / config.period
        content = misplaced < config.feet_stop or self.idle >= config.patience
        settled = np.hypot(*capture) < config.capture_stop and content
        may_stop = not wanted and (settled or not config.recovers)
        after = self.phase + dt / config.period
        half = np.floor(2.0 * after) > np.floor(2.0 * self.phase)
        ends = self.stepping and half and may_stop
        running = (self.stepping or begins) and not ends
        if running and not begins:
            self.phase = after % 1.0
        if ends:
            self.phase = np.floor(2.0 * after) / 2.0 % 1.0
        self.stepping = bool(running)

    def step_rest(self, base: Array, feet: Array, contact: Array, moving: bool, dt: float) -> None:
        """Advance the stop predictor alone."""
        for k, foot in enumerate(base @ feet):
            planted = not moving or contact[k] > LOADED
            self.samples[k] = self.samples[k] + 1 if planted and moving else int(planted)
            if planted:
                self.prints[k] = self.prints[k].toward(PlanarPose.of(foot), 1.0 / self.samples[k])
        middle, here = self.prints[0].toward(self.prints[1], 0.5), PlanarPose.of(base)
        self.stood = 0.0 if moving else self.stood + dt
        if not moving:
            self.rest = STILL
            self.above = middle.to(here) if self.stood > STOOD else self.above
        elif self.above is not None:
            self.rest = self.rest.toward(here.to(middle @ self.above), dt / (SMOOTHING + dt))


def heading_matrix(R: Array) -> Array:
    """Return the (2, 2) rotation of the heading of `R` (3, 3)."""
    c, s = R[:2, 0] / np.hypot(*R[:2, 0])
    return np.array([[c, -s], [s, c]])


def stand_errors(R: Array, com: Array, velocity: Array, soles: Array, stance: Array) -> tuple[Array, float]:
    """Return the capture point (2,) and the misplacement of one robot."""
    height = max(com[2] - soles[:, 2].min(), 0.1)
    point = com[:2] + velocity[:2] * np.sqrt(height / GRAVITY)
    heading = heading_matrix(R).T
    apart = heading @ (soles[0, :2] - soles[1, :2])
    return heading @ (point - soles[:, :2].mean(axis=0)), float(np.linalg.norm(apart - stance))
