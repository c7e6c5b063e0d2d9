"""The skill navigate over a base that follows every twist exactly: frames, what is missing, cancellation."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from tests.skills.test_walk import Ground, outcome

from golem.errors import ConfigError
from golem.interfaces import topics
from golem.interfaces.nav_payloads import MapPlace, OccupancyGrid
from golem.interfaces.payloads import Odometry, OdometrySilence
from golem.skills.navigate import FIRST_MAP, Navigate, NavigateGoal
from golem.types import PlanarPose, Twist

ORIGIN = PlanarPose(0.0, 0.0, 0.0)


@dataclass
class Mapped(Ground):
    """A robot with a map, whose frame is somewhere in odom, from a time on."""

    place: PlanarPose = field(default_factory=lambda: PlanarPose(1.0, -0.5, 0.4))
    from_time: float = 0.0
    drift: float = 0.0

    def _advance(self) -> None:
        super()._advance()
        t = self.context.t
        if t >= self.from_time:
            place = PlanarPose(self.place.x + self.drift * t, self.place.y, self.place.yaw)
            grid = OccupancyGrid(t, place, 0.1, np.zeros((50, 50), np.int8), place)
            self.bus.publish(topics.MAP, grid, t)
            self.bus.publish(topics.MAP_POSE, MapPlace(t, place, ORIGIN), t)


def test_a_goal_on_the_map_is_where_the_map_is() -> None:
    ground = Mapped(offset=0.0)
    goal = NavigateGoal(0.5, 1.0, 0.3)
    result = outcome(ground.run(Navigate().run(ground.context, goal)))
    assert (result.success, result.stage) == (True, "done")
    left = (ground.place @ PlanarPose(0.5, 1.0, 0.3)).to(ground.pose)
    assert math.hypot(left.x, left.y) < 0.035 and abs(left.yaw) < 0.035
    assert ground.stages == ["navigate", "done"] and ground.twist == Twist()


def test_a_goal_on_the_map_stays_where_it_is_in_the_hall_while_odom_drifts() -> None:
    ground = Mapped(offset=0.0, drift=0.01)
    assert outcome(ground.run(Navigate().run(ground.context, NavigateGoal(1.0, 0.0, 0.0)))).success
    place = ground.bus.latest(topics.MAP_POSE)
    assert place is not None
    left = (place.T_odom_map @ PlanarPose(1.0, 0.0, 0.0)).to(ground.pose)
    assert math.hypot(left.x, left.y) < 0.06


@pytest.mark.parametrize("frame", ["odom", "base_link"])
def test_goals_in_other_frames_are_turned_into_goals_on_the_map(frame: str) -> None:
    ground = Mapped(PlanarPose(0.3, 0.2, 0.5), offset=0.0)
    target = PlanarPose(0.9, 0.4, -0.2)
    goal = NavigateGoal(0.9, 0.4, -0.2, frame=frame)  # pyright: ignore[reportArgumentType]
    expected = ground.pose @ target if frame == "base_link" else target
    assert outcome(ground.run(Navigate().run(ground.context, goal))).success
    left = expected.to(ground.pose)
    assert math.hypot(left.x, left.y) < 0.035


def test_without_a_map_a_goal_on_it_is_refused_after_a_while() -> None:
    ground = Ground(offset=0.0)
    result = outcome(ground.run(Navigate().run(ground.context, NavigateGoal(1.0))))
    assert (result.success, result.stage, result.slot) == (False, "locate", "mapper")
    assert "no map" in result.reason and ground.context.t == pytest.approx(FIRST_MAP, abs=0.3)
    assert ground.twist == Twist() and ground.pose == ORIGIN


def test_without_a_map_a_goal_in_odom_is_pursued_by_odometry() -> None:
    ground = Ground(offset=0.0)
    assert outcome(ground.run(Navigate().run(ground.context, NavigateGoal(1.0, frame="odom")))).success
    assert ground.pose.x == pytest.approx(1.0, abs=0.035)


@pytest.mark.parametrize("at", [0.5, 3.0])
def test_an_odometry_that_falls_silent_stops_the_robot_and_is_named(at: float) -> None:
    ground = Mapped(offset=0.0, silent=at)
    result = outcome(ground.run(Navigate().run(ground.context, NavigateGoal(4.0, frame="odom"))))
    assert (result.success, result.slot) == (False, "odometry")
    assert "silent" in result.reason and ground.twist == Twist()


def test_why_the_odometry_is_silent_stands_in_the_result() -> None:
    ground = Mapped(offset=0.0, silent=1.0)
    run = ground.run(Navigate().run(ground.context, NavigateGoal(4.0, frame="odom")), 1.2)
    ground.bus.publish(topics.ODOMETRY_SILENCE, OdometrySilence(1.2, "No scan fits."), 1.2)
    while run.result is None:
        ground._advance()
        run.step()
        ground.node.step(ground.context.t)
    assert run.result.reason.endswith("s: No scan fits.") and ground.twist == Twist()


@pytest.mark.parametrize("frame", ["map", "odom", "base_link"])
def test_an_odometry_that_never_speaks_is_named_and_nothing_moves(frame: str) -> None:
    ground = Ground()
    ground.bus.publish(topics.ODOMETRY_SILENCE, OdometrySilence(0.0, "It waits for the IMU."), 0.0)
    goal = NavigateGoal(1.0, frame=frame)  # pyright: ignore[reportArgumentType]
    result = outcome(ground.run(Navigate().run(ground.context, goal)))
    assert (result.success, result.stage, result.slot) == (False, "locate", "odometry")
    assert result.reason.endswith("where the robot is: It waits for the IMU.") and ground.pose == ORIGIN


@pytest.mark.parametrize("at", [0.05, 1.0, 6.0])
def test_cancelled_at_any_stage_the_robot_stands(at: float) -> None:
    ground = Mapped(offset=0.0, from_time=0.5)
    coroutine = Navigate().run(ground.context, NavigateGoal(2.0, frame="base_link"))
    run = ground.run(coroutine, at)
    assert run.result is None
    run.cancel()
    while run.result is None:
        ground._advance()
        run.step()
        ground.node.step(ground.context.t)
    place = ground.pose
    assert run.result.stage == "cancelled" and ground.twist == Twist()
    for _ in range(50):
        ground._advance()
        ground.node.step(ground.context.t)
    assert ground.pose == place


def test_the_result_says_how_sure_the_odometry_is() -> None:
    ground = Mapped(offset=0.0)
    publish = ground.bus.publish

    def with_covariance(topic, value, t, latency=0.0):  # noqa: ANN001, ANN202
        if topic is topics.ODOMETRY:
            value = Odometry(value.t, value.T_odom_base, None, np.diag([4e-4, 1e-4, 1e-4, 0.0, 0.0, 1e-4]))
        publish(topic, value, t, latency)

    ground.bus.publish = with_covariance
    result = outcome(ground.run(Navigate().run(ground.context, NavigateGoal(0.5, frame="odom"))))
    assert "sure of its place to 2.0 cm and 0.6 deg" in result.reason


def test_a_goal_that_is_too_far_for_its_time_is_refused() -> None:
    ground = Mapped(offset=0.0)
    assert outcome(ground.run(Navigate().run(ground.context, NavigateGoal(50.0, timeout=10.0)))).stage == "refused"
    with pytest.raises(ConfigError, match="finite"):
        NavigateGoal(float("nan"))


def test_a_robot_that_is_content_to_be_near_stands_at_once() -> None:
    exact, near = Mapped(offset=0.0), Mapped(offset=0.0)
    assert outcome(exact.run(Navigate().run(exact.context, NavigateGoal(1.0)))).success
    result = outcome(near.run(Navigate().run(near.context, NavigateGoal(1.0, content=0.2))))
    assert result.success and near.twist == Twist() and near.context.t < exact.context.t - 1.0
    left = (near.place @ PlanarPose(1.0, 0.0, 0.0)).to(near.pose)
    assert 0.1 < math.hypot(left.x, left.y) < 0.25
    with pytest.raises(ConfigError, match="content of a goal"):
        NavigateGoal(1.0, content=-1.0)
