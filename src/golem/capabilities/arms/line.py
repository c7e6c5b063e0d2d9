"""Straight-line motion of a hand: position along the line, rotation along the geodesic, trapezoidal speed."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.base import check_pose
from golem.errors import ConfigError
from golem.types import Array


class Line:
    """Moves a frame from one pose to another with both speeds and both accelerations bounded.

    One profile s(t) in [0, 1] drives position p = p0 + s (p1 - p0) and rotation R = R0 exp(s log(R0^T R1)), so the
    motion is straight and the hand turns evenly along it. The profile accelerates, cruises and brakes; a motion too
    short to reach its cruising speed has no cruise.

    Attributes:
        duration: time from start to goal [s]; 0 if they coincide.
        length: distance between start and goal [m].
        angle: angle between start and goal [rad].
    """

    def __init__(
        self,
        T_start: Array,
        T_goal: Array,
        v_max: float = 0.25,
        w_max: float = 1.0,
        a_max: float = 1.0,
        alpha_max: float = 4.0,
    ) -> None:
        """Plan the profile.

        Args:
            T_start: (4, 4) pose of the moved frame at the start.
            T_goal: (4, 4) pose at the end, in the same frame.
            v_max: speed limit [m/s].
            w_max: rate of turn limit [rad/s].
            a_max: acceleration limit [m/s^2].
            alpha_max: angular acceleration limit [rad/s^2].

        Raises:
            TargetError: a pose is not a finite rigid transform.
            ConfigError: a limit is not positive.
        """
        if not min(v_max, w_max, a_max, alpha_max) > 0.0:
            raise ConfigError("The limits of a line (v_max, w_max, a_max, alpha_max) must be positive.")
        self._start = check_pose("The start of the line", T_start).copy()
        self._goal = check_pose("The goal of the line", T_goal).copy()
        self._travel = self._goal[:3, 3] - self._start[:3, 3]
        self._turn = pin.log3(self._start[:3, :3].T @ self._goal[:3, :3])
        self.length = float(np.linalg.norm(self._travel))
        self.angle = float(np.linalg.norm(self._turn))
        # The slower of the two motions sets the profile's own limits, in 1/s and 1/s^2.
        slowness = max(self.length / v_max, self.angle / w_max)
        heaviness = max(self.length / a_max, self.angle / alpha_max)
        if slowness < 1e-9:
            self._ramp = self._peak = self._rise = self.duration = 0.0
            return
        self._rise = 1.0 / heaviness
        self._peak = min(1.0 / slowness, np.sqrt(self._rise))
        self._ramp = self._peak / self._rise
        self.duration = 1.0 / self._peak + self._ramp

    def fraction(self, t: float) -> float:
        """Return how much of the way is done at `t` [s] after the start, 0 to 1."""
        if t >= self.duration:
            return 1.0
        if t <= 0.0:
            return 0.0
        if t < self._ramp:
            return 0.5 * self._rise * t * t
        rest = self.duration - t
        if rest < self._ramp:
            return 1.0 - 0.5 * self._rise * rest * rest
        return self._peak * (t - 0.5 * self._ramp)

    def pose(self, t: float) -> Array:
        """Return the (4, 4) pose at `t` [s] after the start; exactly the start before 0, the goal after the end."""
        if t <= 0.0 and self.duration > 0.0:
            return self._start.copy()
        s = self.fraction(t)
        if s >= 1.0:
            return self._goal.copy()
        T = self._start.copy()
        T[:3, 3] += s * self._travel
        T[:3, :3] = T[:3, :3] @ pin.exp3(s * self._turn)
        return T
