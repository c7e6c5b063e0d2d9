"""Base of the planners: checks before the search, and timing and a second check of the path it found.

A path of joints is timed with rounded corners, as fast as the limits allow, at rest at both ends. Each corner becomes a
parabola that leaves it at most a given distance away (as in Kunz and Stilman, 2012, with a parabola in place of the
arc). On a fine grid the speed is then bounded by the limits of velocity, of hand speed and of the curvature's share of
the acceleration, and swept forward and backward with the other share.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from golem.capabilities.arms.trajectory import interpolate
from golem.capabilities.planning import plan_kernel
from golem.capabilities.planning.base import NUM_JOINTS, Plan, PlanRefused, PlanRequest, Refusal, check_request
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.errors import ConfigError
from golem.types import Array

GRID = 0.02
"""Distance of the points of a timed path [rad in the joint that moves most]."""
CURVED = 0.5
"""Share of the acceleration that curves may use; the rest speeds up and brakes."""
SLACK = 0.97
"""Share of the speed limits that is planned with: between the points, the cubic is a little faster."""


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """How fast the joints and the hands may move.

    Attributes:
        speed: (n,) of each joint [rad/s].
        accel: (n,) of each joint [rad/s^2].
        hand_speed: of every hand [m/s].
    """

    speed: Array
    accel: Array
    hand_speed: float


def round_corners(corners: Array, cut: float, free: Callable[[Array], bool]) -> Array:
    """Return (m, n) points of a path whose corners are parabolas, no two farther apart than `GRID`.

    Args:
        corners: (k, n) of the path, k >= 2, neighbours apart.
        cut: how far before and after a corner the curve may begin and end [rad, Euclidean].
        free: says whether points (j, n) of a curve may be gone to; where not, a curve is made smaller, and at last
            none is.
    """
    legs = np.diff(corners, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    ways = legs / lengths[:, None]
    points: list[Array] = [corners[0]]
    for i in range(1, len(corners) - 1):
        most = min(cut, 0.5 * lengths[i - 1], 0.5 * lengths[i])
        for share in (1.0, 0.4, 0.15):
            a = corners[i] - share * most * ways[i - 1]
            b = corners[i] + share * most * ways[i]
            count = max(4, int(np.ceil(np.abs(b - a).max() / GRID)) + 2)
            u = np.linspace(0.0, 1.0, count + 1)[:, None]
            curve = (1 - u) ** 2 * a + 2 * u * (1 - u) * corners[i] + u**2 * b
            if free(curve):
                points += list(curve)
                break
        else:
            points.append(corners[i])
    points.append(corners[-1])
    out: list[Array] = [points[0]]
    for point in points[1:]:
        gap = float(np.abs(point - out[-1]).max())
        if gap < 1e-9:
            continue
        parts = int(np.ceil(gap / GRID))
        start = out[-1]
        out += [start + (point - start) * (k / parts) for k in range(1, parts + 1)]
    if len(out) == 2:
        # Two points at rest would need an infinite time between them.
        out.insert(1, 0.5 * (out[0] + out[1]))
    return np.array(out)


def time_path(points: Array, limits: MotionLimits, hands: Array) -> tuple[Array, Array]:
    """Return times (m,) [s] and velocities (m, n) [rad/s] of the points (m, n) of a path, m >= 3.

    No two neighbours are alike; the hands are at `hands` (m, k, 3) there [m].
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    tangents = steps / lengths[:, None]
    at = np.concatenate(([tangents[0]], 0.5 * (tangents[1:] + tangents[:-1]), [tangents[-1]]))
    middle = 0.5 * (lengths[1:] + lengths[:-1])
    curvature = np.zeros_like(points)
    curvature[1:-1] = np.diff(tangents, axis=0) / middle[:, None]
    both = np.maximum(np.abs(tangents[np.r_[0, : len(tangents)]]), np.abs(tangents[np.r_[: len(tangents), -1]]))
    with np.errstate(divide="ignore"):
        cap = (SLACK * limits.speed / both).min(axis=1)
        cap = np.minimum(cap, np.sqrt((CURVED * limits.accel / np.abs(curvature)).min(axis=1)))
        moved = np.linalg.norm(np.diff(hands, axis=0), axis=2).max(axis=1) / lengths
        fastest = SLACK * limits.hand_speed / moved
    cap = np.minimum(cap, np.minimum(np.r_[fastest, np.inf], np.r_[np.inf, fastest]))
    v = plan_kernel.speeds_along(cap, lengths, tangents, (1.0 - CURVED) * limits.accel)
    return np.concatenate(([0.0], np.cumsum(2.0 * lengths / (v[1:] + v[:-1])))), at * v[:, None]


FINE = 0.01
"""Longest step of the checks that accept a path and a trajectory [rad in a joint]."""
STILL = 1e-6
"""Two postures nearer than this are one [rad]."""
STILL_TIME = 0.02
"""Duration of a trajectory that stays where it is [s]."""


@dataclass(frozen=True)
class PathPlannerConfig:
    """Margins, limits and effort.

    Attributes:
        latency: declared time of a plan [s]; the median of `golem bench arms` is below it.
        world_margin: distance kept between the robot's spheres and the world [m].
        search_margin: distance kept on top of that while searching, from itself and from the world [m], where start
            and goals allow it: what is accepted in fine steps is then seldom refused.
        arm_speed: speed limit of the arms' joints [rad/s].
        torso_speed: that of the torso [rad/s].
        arm_accel: acceleration limit of the arms' joints [rad/s^2].
        torso_accel: that of the torso [rad/s^2].
        corner: how far from a corner a curve may begin [rad].
        attempts: how often a search may begin anew when its path is not accepted.
    """

    latency: float = 0.06
    world_margin: float = 0.01
    search_margin: float = 0.002
    arm_speed: float = 1.5
    torso_speed: float = 0.3
    arm_accel: float = 4.0
    torso_accel: float = 1.0
    corner: float = 0.3
    attempts: int = 4

    def __post_init__(self) -> None:
        for name in ("arm_speed", "torso_speed", "arm_accel", "torso_accel", "corner", "attempts"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"The planner's option {name} must be positive, not {getattr(self, name)}.")
        for name in ("latency", "world_margin", "search_margin"):
            if not getattr(self, name) >= 0.0:
                raise ConfigError(f"The planner's option {name} must not be negative: {getattr(self, name)}.")


class Effort:
    """Counts the postures that were looked at: `used` so far, and `left` until it says to give up."""

    def __init__(self, request: PlanRequest) -> None:
        self.used, self._most, self._stop = 0, request.effort, request.stop

    @property
    def left(self) -> int:
        """Postures that may still be looked at."""
        return self._most - self.used

    def spend(self, checks: int) -> None:
        """Count `checks` more. Raises PlanRefused: the caller has given up."""
        self.used += checks
        if self._stop():
            raise PlanRefused(Refusal.STOPPED, "The caller gave the plan up.")


class PathPlanner(ABC):
    """A planner that finds a path first and times it then; see `ArmPlanner` for the contract.

    Attributes:
        robot: what of the robot does not change.
        speed, accel: (15,) limits of the joints [rad/s, rad/s^2].
    """

    def __init__(self, config: PathPlannerConfig | None = None) -> None:
        self.config = c = config or PathPlannerConfig()
        self.latency = c.latency
        self.robot = PlanningRobot()
        self.speed: Array = np.full(NUM_JOINTS, c.arm_speed)
        self.accel: Array = np.full(NUM_JOINTS, c.arm_accel)
        self.speed[0], self.accel[0] = c.torso_speed, c.torso_accel

    @abstractmethod
    def find(
        self, space: JointSpace, q: Array, goals: Array, rng: np.random.Generator, effort: Effort, attempt: int
    ) -> Array:
        """Return the corners (k, 15), k >= 2, of a free path from `q` (15,) to one of `goals` (m, 15).

        The path of an earlier `attempt` did not hold in fine steps; the first is 0. Raises PlanRefused: none was found.
        """

    def plan(self, request: PlanRequest) -> Plan:
        q, goals = check_request(request)
        c, effort = self.config, Effort(request)
        rules, held = tuple(request.rules), tuple(request.held)
        space = JointSpace(self.robot, q, request.world, rules, held, (0.0, c.world_margin))
        effort.spend(1)
        start = space.verdict(q)
        if start:
            raise PlanRefused(Refusal.START, f"The arms cannot set out from where they are: {space.reason(start, q)}.")
        still = np.abs(goals - q).max(axis=1) <= STILL
        if still.any():
            points = np.array([q, goals[int(still.argmax())]])
            return Plan(np.array([0.0, STILL_TIME]), points, np.zeros_like(points), points, effort.used)
        verdicts = space.verdicts(goals)
        effort.spend(len(goals))
        if verdicts.all():
            reason = space.reason(int(verdicts[0]), goals[0])
            text = "The goal may not be gone to" if len(goals) == 1 else f"None of {len(goals)} goals may be gone to"
            raise PlanRefused(Refusal.GOAL, f"{text}: {reason}.")
        goals = goals[verdicts == 0]
        rng = np.random.default_rng(request.seed)
        limits = MotionLimits(request.speed * self.speed, self.accel, request.hand_speed)
        for attempt in range(c.attempts):
            extra = c.search_margin if attempt < c.attempts - 1 else 0.0
            wide = space.shrunk((extra, c.world_margin + extra))
            ends_free = wide.verdict(q) == 0 and (wide.verdicts(goals) == 0).any()
            corners = self.find(wide if ends_free else space, q, goals, rng, effort, attempt)
            plan = self._timed(space, corners, limits, effort)
            if plan is not None:
                return plan
        raise PlanRefused(Refusal.NO_PATH, f"No path held in {c.attempts} checks at steps of {FINE} rad.")

    def _timed(self, space: JointSpace, corners: Array, limits: MotionLimits, effort: Effort) -> Plan | None:
        """Return the trajectory along `corners`, or None if it or they are not free in fine steps."""

        def free(points: Array) -> bool:
            effort.spend(len(points))
            return not space.verdicts(points).any()

        for a, b in zip(corners, corners[1:], strict=False):
            effort.spend(int(np.abs(b - a).max() / FINE) + 1)
            if not space.free_line(a, b, FINE):
                return None
        for cut in (self.config.corner, 0.02):
            points = round_corners(corners, cut, free)
            times, dq = time_path(points, limits, space.hands(points))
            if free(fine_points(times, points, dq)):
                return Plan(times, points, dq, corners, effort.used)
        return None


def fine_points(times: Array, q: Array, dq: Array) -> Array:
    """Return (m, n) postures on a trajectory, its points among them, no two neighbours farther apart than `FINE`."""
    # A cubic that sets off from rest is up to twice as fast as its mean.
    parts = np.maximum(1, np.ceil(2.0 * np.abs(np.diff(q, axis=0)).max(axis=1) / FINE)).astype(int)
    s = np.concatenate(
        [t0 + (t1 - t0) * np.arange(k) / k for t0, t1, k in zip(times, times[1:], parts, strict=False)] + [times[-1:]]
    )
    return interpolate(times, q, dq, s)
