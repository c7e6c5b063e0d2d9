"""The follower on a simple walker: it lags, steps on for a while when told to stop, and slips as it stops."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from golem.capabilities.navigation.base import Navigator, NavInputs
from golem.capabilities.navigation.goto import GoTo, GoToConfig
from golem.errors import ConfigError
from golem.interfaces.nav_payloads import NavStep
from golem.types import PlanarPose, Twist

DT = 0.01
DEAD_BAND = 0.1


class Walker:
    """A walking base: velocity follows the twist with a lag; a stop takes the rest of a step, and ends with a slip."""

    def __init__(
        self, seed: int = 0, noise: float = 0.0, slip: float = 0.0, gain: float = 1.0, coast: float = 0.0
    ) -> None:
        self._rng = np.random.default_rng(seed)
        self._noise, self._slip, self._gain, self._coast = noise, slip, gain, coast
        self.stops = 0
        self.pose = PlanarPose(0.0, 0.0, 0.0)
        self.velocity = np.zeros(3)
        self.stepping = False
        self._left = 0.0
        self.twists: list[Twist] = []

    def measured(self) -> PlanarPose:
        """Return the pose with a centimetre and a degree of noise per unit of `noise`."""
        x, y, yaw = self._noise * self._rng.normal(size=3) * (0.01, 0.01, math.radians(1.0))
        return PlanarPose(self.pose.x + x, self.pose.y + y, self.pose.yaw + yaw)

    def step(self, twist: Twist) -> None:
        self.twists.append(twist)
        values = np.array([twist.vx, twist.vy, twist.wz])
        if np.linalg.norm(values) < (0.02 if self.stepping else DEAD_BAND):
            values[:] = 0.0
            self._left -= DT
        else:
            self._left = 0.35
        if self.stepping and self._left <= 0.0:
            values = self._slip * self._rng.normal(size=3) * (0.01, 0.01, math.radians(0.5))
            self.pose = self.pose @ PlanarPose(*values.tolist()) @ PlanarPose(self._coast, 0.0, 0.0)
            self.stops += 1
        self.stepping = self._left > 0.0
        self.velocity = (self.velocity + DT / 0.2 * (self._gain * values - self.velocity)) * self.stepping
        self.pose = self.pose @ PlanarPose(*(DT * self.velocity).tolist())


def go(navigator: Navigator, walker: Walker, goal: PlanarPose, seconds: float = 40.0) -> NavStep:
    """Walk until the navigator is content, at most for `seconds`."""
    navigator.start(goal)
    for _ in range(round(seconds / DT)):
        course = navigator.step(NavInputs(walker.measured(), walker.stepping), DT)
        if course.arrived:
            return course
        walker.step(course.twist)
    raise AssertionError(f"not there after {seconds:g} s; {course.left} is left")


def error(walker: Walker, goal: PlanarPose) -> tuple[float, float]:
    left = walker.pose.to(goal)
    return math.hypot(left.x, left.y), abs(left.yaw)


GOALS = [
    PlanarPose(2.0, 0.5, 0.5),
    PlanarPose(-0.5, 0.3, 0.0),
    PlanarPose(0.0, -1.5, 3.0),
    PlanarPose(0.05, 0.0, 0.0),
    PlanarPose(0.0, 0.0, 0.2),
    PlanarPose(6.0, 0.0, 0.0),
]


@pytest.mark.parametrize("goal", GOALS)
def test_it_arrives_and_stands_there(goal: PlanarPose) -> None:
    walker = Walker()
    course = go(GoTo(), walker, goal)
    distance, turn = error(walker, goal)
    assert distance < GoToConfig().accept + 0.005
    assert turn < GoToConfig().straight + 0.002
    assert not walker.stepping
    assert course.twist == Twist()
    assert math.hypot(course.left.x, course.left.y) == pytest.approx(distance, abs=0.005)


def test_with_noise_and_slip_the_errors_are_those_of_the_issue() -> None:
    """1 cm and 1 deg of odometry noise, stops that slip by 1 cm, a walker a fifth too slow: 2 m away, +-0.6 rad."""
    errors = []
    rng = np.random.default_rng(1)
    for seed in range(30):
        walker = Walker(seed, noise=1.0, slip=1.0, gain=0.8)
        d, bearing, yaw = rng.uniform((1.5, -0.6, -0.6), (2.5, 0.6, 0.6))
        goal = PlanarPose(d * math.cos(bearing), d * math.sin(bearing), yaw)
        go(GoTo(), walker, goal)
        errors.append(error(walker, goal))
    distance, turn = np.array(errors).T
    assert distance.mean() <= 0.025
    assert np.percentile(distance, 95) <= 0.050
    assert np.degrees(np.sqrt((turn**2).mean())) <= 1.5


def test_no_twist_is_beyond_its_bounds_or_lost_in_the_dead_band() -> None:
    walker = Walker(3, noise=1.0, slip=1.0)
    go(GoTo(), walker, PlanarPose(2.0, -1.0, 1.0))
    twists = np.array([(t.vx, t.vy, t.wz) for t in walker.twists])
    assert (np.abs(twists) <= np.array(GoToConfig().speed) + 1e-9).all()
    sizes = np.linalg.norm(twists, axis=1)
    assert ((sizes == 0.0) | (sizes >= GoToConfig().creep - 1e-9)).all()
    assert sizes[0] >= GoToConfig().pulse


def test_a_goal_near_by_is_reached_on_a_straight_line_without_turning_away() -> None:
    walker = Walker()
    navigator = GoTo()
    goal = PlanarPose(0.6, 0.6, 0.0)
    navigator.start(goal)
    for _ in range(1500):
        course = navigator.step(NavInputs(walker.pose, walker.stepping), DT)
        walker.step(course.twist)
        assert abs(walker.pose.x - walker.pose.y) < 0.05
        assert abs(walker.pose.yaw) < 0.05
    assert error(walker, goal)[0] < 0.04


def test_how_far_a_stop_moves_the_robot_is_learned_once_or_told() -> None:
    walker = Walker(coast=0.05)
    learner = GoTo()
    goals = [PlanarPose(1.0, 0.2, 0.1), PlanarPose(2.0, 0.0, 0.0), PlanarPose(3.0, -0.2, 0.2)]
    stops = []
    for goal in goals:
        go(learner, walker, goal)
        assert error(walker, goal)[0] < GoToConfig().accept + 0.005
        stops.append(walker.stops)
    assert stops == [2, 3, 4]

    told = Walker(coast=0.05)
    go(GoTo(GoToConfig(coast=(0.05, 0.0, 0.0))), told, goals[0])
    assert told.stops == 1


def test_where_stops_scatter_one_of_them_is_no_lesson() -> None:
    def stops(learn: float) -> int:
        walkers = [Walker(seed, slip=3.0) for seed in range(20)]
        for walker in walkers:
            go(GoTo(GoToConfig(learn=learn)), walker, PlanarPose(0.5, 0.0, 0.0))
        return sum(walker.stops for walker in walkers)

    assert stops(0.5) < stops(1.0)


def test_a_robot_that_has_just_set_off_is_not_told_to_stop() -> None:
    walker = Walker()
    go(GoTo(), walker, PlanarPose(0.06, 0.0, 0.0))
    told = next(k for k in range(len(walker.twists) - 1, 0, -1) if walker.twists[k] != Twist())
    assert told * DT >= GoToConfig().march - DT
    quick = Walker()
    go(GoTo(GoToConfig(march=0.0)), quick, PlanarPose(0.06, 0.0, 0.0))
    assert len(quick.twists) < len(walker.twists)


def test_a_robot_that_stands_at_the_goal_does_not_stir() -> None:
    walker = Walker(coast=0.05)
    go(GoTo(GoToConfig(coast=(0.05, 0.0, 0.0))), walker, PlanarPose(0.0, 0.0, 0.0))
    assert all(t == Twist() for t in walker.twists)
    assert walker.stops == 0


def test_far_away_it_faces_the_goal() -> None:
    walker = Walker()
    navigator = GoTo()
    navigator.start(PlanarPose(0.0, 5.0, 0.0))
    for _ in range(600):
        walker.step(navigator.step(NavInputs(walker.pose, walker.stepping), DT).twist)
    assert walker.pose.yaw == pytest.approx(math.pi / 2, abs=0.1)


def test_it_is_not_there_before_the_robot_stands() -> None:
    navigator = GoTo()
    here = PlanarPose(1.0, 2.0, 0.3)
    navigator.start(here)
    for _ in range(300):
        course = navigator.step(NavInputs(here, True), DT)
        assert not course.arrived
        assert course.twist == Twist()
    rest = [navigator.step(NavInputs(here, False), DT).arrived for _ in range(300)]
    config = GoToConfig()
    assert rest.index(True) == pytest.approx((config.settle + config.rest) / DT, abs=1)


def test_a_robot_that_is_moved_while_it_stops_starts_over() -> None:
    walker = Walker()
    navigator = GoTo()
    goal = PlanarPose(1.0, 0.0, 0.0)
    go(navigator, walker, goal)
    walker.pose = PlanarPose(walker.pose.x - 0.1, walker.pose.y, walker.pose.yaw)
    courses = [navigator.step(NavInputs(walker.pose, False), DT) for _ in range(100)]
    assert courses[-1].twist.vx >= GoToConfig().pulse - 1e-9
    assert not courses[-1].arrived


def test_it_turns_the_short_way_round_past_half_a_turn() -> None:
    walker = Walker()
    walker.pose = PlanarPose(0.0, 0.0, 3.0)
    go(GoTo(), walker, PlanarPose(0.0, 0.0, -3.0))
    assert all(t.wz >= 0.0 for t in walker.twists)
    assert len(walker.twists) < 500


def test_a_robot_that_stops_badly_is_not_chased_for_ever() -> None:
    goal = PlanarPose(1.0, 0.0, 0.0)
    go(GoTo(), Walker(noise=1.0, slip=10.0), goal, seconds=60.0)
    with pytest.raises(AssertionError, match="not there after 120 s"):
        go(GoTo(GoToConfig(widen=1.0)), Walker(noise=1.0, slip=10.0), goal, seconds=120.0)


@pytest.mark.parametrize(
    "change", [{"smoothing": 0.0}, {"speed": (0.6, 0.0, 0.6)}, {"widen": 0.5}, {"rest": -1.0}, {"learn": 1.5}]
)
def test_numbers_that_cannot_be_meant_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=f"goto option {next(iter(change))}"):
        GoToConfig(**change)


def test_a_push_during_a_stop_is_not_learned() -> None:
    navigator, walker = GoTo(), Walker()
    go(navigator, walker, PlanarPose(0.5, 0.0, 0.0))
    navigator.start(PlanarPose(1.0, 0.0, 0.0))
    pushed = False
    for _ in range(4000):
        course = navigator.step(NavInputs(walker.measured(), walker.stepping), DT)
        if course.twist == Twist() and not pushed:
            walker.pose, pushed = PlanarPose(3.0, 0.0, 0.0), True
        walker.step(course.twist)
        if course.arrived:
            break
    assert pushed and error(walker, PlanarPose(1.0, 0.0, 0.0))[0] < 0.05
