"""Straight-line motion of a hand: position along the line, rotation along the geodesic, trapezoidal speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.base import check_joints, check_pose
from golem.capabilities.arms.diff_ik import DiffIK
from golem.capabilities.planning.base import PlanRefused, Refusal
from golem.capabilities.planning.joint_space import JointSpace
from golem.errors import ConfigError
from golem.robots.model.table import JOINT_NAMES
from golem.types import NUM_JOINTS, UPPER, Array, Side


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
        """Plan the profile from `T_start` to `T_goal`, (4, 4) each, in one frame.

        Its limits are those of speed [m/s], rate of turn [rad/s] and the two accelerations [m/s^2, rad/s^2].
        Raises TargetError: a pose is not a finite rigid transform; ConfigError: a limit is not positive.
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


DT = 0.01
"""Tick of the trial run [s], that of the arms."""
SETTLE = 0.2
"""Time after the end of the line that the hand gets to arrive [s]."""
AT_LIMIT = 1e-3
"""A joint this near to its limit is at it [rad]."""


@dataclass(frozen=True, slots=True)
class LineCheck:
    """What became of a line that was tried.

    Attributes:
        deviation: largest distance of the hand from where the line has it [m].
        tilt: largest angle of its approach axis from where the line has it [rad].
        left: distance of the hand from the end of the line at last [m].
        q: (n, 15) joints on the way, one row per tick [rad].
    """

    deviation: float
    tilt: float
    left: float
    q: Array


class LineChecker:
    """Tries lines on an arm of its own."""

    def __init__(self) -> None:
        self.ik = DiffIK()

    def check(
        self,
        side: Side,
        T_goal: Array,
        q: Array,
        v_max: float,
        w_max: float = 1.5,
        deviation: float = 0.001,
        tilt: float = np.deg2rad(0.5),
        space: JointSpace | None = None,
    ) -> LineCheck:
        """Return what the arm would do on the way to `T_goal`, if it may; what it touches already it may leave.

        Args:
            T_goal: (4, 4) where it is to go, in base_link.
            q: (15,) command state of the joints that it starts from [rad].
            v_max: speed [m/s].
            w_max: rate of turn [rad/s].
            deviation: distance from the line that is allowed [m].
            tilt: angle of the approach axis that is [rad].
            space: what the postures on the way have to be free in; None looks at none.

        Raises:
            TargetError: the goal is no rigid transform, or `q` no joints.
            PlanRefused: the hand would leave the line, or touch something; says by how much, or what.
        """
        full = np.zeros(NUM_JOINTS)
        full[UPPER] = q
        self.ik.reset(check_joints("The joints that a line starts from", full))
        line = Line(self.ik.kinematics.pose(side, self.ik.q), T_goal, v_max, w_max)
        rows, worst, turned, late, away = [self.ik.q.copy()], 0.0, 0.0, 0.0, 0.0
        for i in range(1, int(np.ceil((line.duration + SETTLE) / DT)) + 1):
            wanted = line.pose(i * DT)
            targets = (wanted, None) if side == "left" else (None, wanted)
            self.ik.step(*targets, full, DT)
            rows.append(self.ik.q.copy())
            here = self.ik.kinematics.placement(side).homogeneous
            away = float(np.linalg.norm(here[:3, 3] - wanted[:3, 3]))
            if away > worst:
                worst, late = away, line.fraction(i * DT)
            turned = max(turned, float(np.arccos(np.clip(here[:3, 2] @ wanted[:3, 2], -1.0, 1.0))))
        path = np.array(rows)
        if worst > deviation or turned > tilt:
            raise PlanRefused(
                Refusal.OFF_LINE,
                f"The {side} hand would leave the straight line of {line.length * 1e3:.0f} mm by {worst * 1e3:.1f} mm "
                f"and {np.rad2deg(turned):.1f} deg, after {100 * late:.0f} % of it{self._stopped()}.",
            )
        if space is not None:
            verdicts = space.verdicts(path)
            free = np.flatnonzero(verdicts == 0)
            # An arm that begins in contact may leave it; nothing may be touched afterwards.
            first = int(free[0]) if len(free) else len(path)
            blocked = first + np.flatnonzero(verdicts[first:])
            if len(blocked):
                k = int(blocked[0])
                raise PlanRefused(
                    Refusal.NO_PATH,
                    f"The {side} hand cannot go straight for {line.length * 1e3:.0f} mm: after "
                    f"{100 * line.fraction(k * DT):.0f} % of it, {space.reason(int(verdicts[k]), path[k])}.",
                )
        return LineCheck(worst, turned, away, path)

    def _stopped(self) -> str:
        gaps = np.minimum(self.ik.q - self.ik.lower, self.ik.upper - self.ik.q)
        names = [JOINT_NAMES[UPPER][j] for j in np.flatnonzero(gaps < AT_LIMIT)]
        return f"; at a limit: {', '.join(names)}" if names else ""
