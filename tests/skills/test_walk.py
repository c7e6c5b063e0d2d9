"""Walking and standing as skills, over a base that follows every twist exactly."""

from __future__ import annotations

import math
from collections.abc import Coroutine
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from tests.skills.conftest import modules

from golem.capabilities.navigation.base import Navigator, NavInputs
from golem.capabilities.navigation.goto import GoTo
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.interfaces.nav_payloads import NavStep
from golem.interfaces.payloads import LegStatus, Odometry
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.runtime.contract_check import ContractCheck
from golem.runtime.navigator_node import NavigatorNode
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.runner import SkillRun
from golem.skills.walk import Stand, StandGoal, Walk, WalkGoal
from golem.types import Array, BaseEstimate, PlanarPose, Twist

PERIOD = 0.01


def pose(x: float, y: float, yaw: float) -> Array:
    T = np.eye(4)
    T[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
    T[:2, 3] = x, y
    return T


@dataclass
class Ground:
    """A robot that moves as its twist says, and locates itself by its estimator, by odometry, or not at all."""

    start: PlanarPose = field(default_factory=lambda: PlanarPose(0.0, 0.0, 0.0))
    reports: bool = True
    stuck: bool = False
    reason: str = ""
    offset: float | None = None
    silent: float = math.inf
    speed: float = 0.85
    heights: tuple[float, float, float] | None = None
    navigator: Navigator = field(default_factory=GoTo)

    def __post_init__(self) -> None:
        self.bus = Bus()
        self.context = Context(self.bus, Kinematics(), PERIOD, modules())
        contract = ContractCheck("navigator", "goto")
        self.node = NavigatorNode(self.bus, self.navigator, contract, self.context.legs)
        self.pose = self.start
        self.stages: list[str] = []
        self._tick = 0
        self._advance()

    @property
    def twist(self) -> Twist:
        """What the legs were told last."""
        return self.bus.latest(topics.TWIST) or Twist()

    def run(self, coroutine: Coroutine[None, None, SkillResult], seconds: float = 60.0) -> SkillRun:
        """Run a skill to its end, or for so many seconds."""
        run = SkillRun("scripted", coroutine)
        for _ in range(round(seconds / PERIOD)):
            if run.result is not None:
                break
            self._advance()
            run.step()
            self.node.step(self.context.t)
            feedback = self.bus.latest(topics.FEEDBACK)
            if feedback is not None and self.stages[-1:] != [feedback.stage]:
                self.stages.append(feedback.stage)
        return run

    def _advance(self) -> None:
        self._tick += 1
        t, twist = self._tick * PERIOD, self.twist
        if not self.stuck:
            self.pose = self.pose @ PlanarPose(twist.vx * PERIOD, twist.vy * PERIOD, twist.wz * PERIOD)
        T = pose(self.pose.x, self.pose.y, self.pose.yaw)
        if self.offset is not None and t < self.silent:
            self.bus.publish(topics.ODOMETRY, Odometry(t, T.copy()), t)
            T[0, 3] += self.offset
        self.bus.publish(topics.BASE, BaseEstimate(t, T), t)
        moving = twist != Twist()
        applied = Twist() if self.reason else twist
        status = LegStatus(
            t,
            twist,
            applied,
            False,
            self.reason,
            moving,
            moving,
            PlanarPose(0.0, 0.0, 0.0),
            np.array([0.0, 0.5]),
            "almi",
            speed=self.speed,
            height=twist.height,
            heights=self.heights,
        )
        if self.reports:
            self.bus.publish(topics.LEG_STATUS, status, t)
        self.context.refresh(t)


def outcome(run: SkillRun) -> SkillResult:
    assert run.result is not None
    return run.result


def test_it_walks_to_a_pose_in_odom_and_stands() -> None:
    ground = Ground(PlanarPose(0.3, -0.2, 0.5))
    result = outcome(ground.run(Walk().run(ground.context, WalkGoal(1.5, 1.0, -0.4, frame="odom"))))
    assert (result.success, result.stage) == (True, "done")
    assert result.timings["walk"] > 3.0
    left = ground.pose.to(PlanarPose(1.5, 1.0, -0.4))
    assert math.hypot(left.x, left.y) < 0.035
    assert abs(left.yaw) < 0.035
    assert ground.twist == Twist()
    assert ground.stages == ["walk", "done"]


def test_a_goal_in_the_base_frame_is_seen_from_where_the_robot_stands() -> None:
    ground = Ground(PlanarPose(2.0, 1.0, math.pi / 2))
    assert outcome(ground.run(Walk().run(ground.context, WalkGoal(1.0, 0.0, 0.0, frame="base_link")))).success
    left = ground.pose.to(PlanarPose(2.0, 2.0, math.pi / 2))
    assert math.hypot(left.x, left.y) < 0.035


def test_an_odometry_counts_more_than_the_base_estimate() -> None:
    ground = Ground(offset=0.5)
    assert outcome(ground.run(Walk().run(ground.context, WalkGoal(1.0, 0.0)))).success
    assert ground.pose.x == pytest.approx(1.0, abs=0.035)


def test_a_robot_that_does_not_get_there_gives_up_and_stands() -> None:
    ground = Ground(stuck=True)
    result = outcome(ground.run(Walk().run(ground.context, WalkGoal(1.0, 0.0, timeout=2.0))))
    assert (result.success, result.stage, result.slot) == (False, "walk", "navigator")
    assert "Not at the goal after 2 s: 1.00 m and 0 deg are left." in result.reason
    assert ground.twist == Twist()


def test_a_navigator_that_finds_no_way_ends_the_walk_with_its_reason() -> None:
    class Blocked(GoTo):
        def step(self, inputs: NavInputs, dt: float) -> NavStep:
            step = super().step(inputs, dt)
            return step if inputs.pose.x < 0.5 else NavStep.failed("A wall is in the way.", step.left)

    ground = Ground(navigator=Blocked())
    result = outcome(ground.run(Walk().run(ground.context, WalkGoal(1.0, 0.0))))
    assert (result.success, result.stage, result.slot) == (False, "walk", "navigator")
    assert result.reason == "A wall is in the way."
    assert ground.twist == Twist() and ground.pose.x < 0.55


def test_legs_that_do_not_move_are_named_with_their_reason() -> None:
    ground = Ground(stuck=True, reason="the commanded twist is outside the envelope")
    result = outcome(ground.run(Walk().run(ground.context, WalkGoal(1.0, 0.0, timeout=2.0))))
    assert (result.success, result.stage, result.slot) == (False, "walk", "lower_body")
    assert "The legs do not move: the commanded twist is outside the envelope." in result.reason


def test_legs_that_do_not_report_are_named() -> None:
    ground = Ground(reports=False)
    result = outcome(ground.run(Walk().run(ground.context, WalkGoal(1.0, 0.0))))
    assert (result.success, result.stage, result.slot) == (False, "walk", "lower_body")


def test_a_cancelled_walk_stands() -> None:
    ground = Ground()
    run = ground.run(Walk().run(ground.context, WalkGoal(3.0, 0.0)), seconds=2.0)
    assert ground.twist.vx > 0.1
    run.cancel()
    assert outcome(run).stage == "cancelled"
    assert ground.twist == Twist()


def test_it_stands_for_as_long_as_it_is_told() -> None:
    ground = Ground()
    run: Any = ground.run(Stand().run(ground.context, StandGoal(1.5)), seconds=1.4)
    assert run.result is None
    run = ground.run(Stand().run(ground.context, StandGoal(1.5)), seconds=1.6)
    assert outcome(run).success
    assert ground.twist == Twist()


def test_an_odometry_that_falls_silent_stops_the_robot() -> None:
    ground = Ground(offset=0.5, silent=1.0)
    result = outcome(ground.run(Walk().run(ground.context, WalkGoal(3.0, 0.0))))
    assert (result.success, result.stage, result.slot) == (False, "walk", "odometry")
    assert "silent for 0.5 s" in result.reason and ground.twist == Twist()
    assert ground.pose.x < 1.0


def test_legs_that_do_not_walk_are_named_before_anything_moves() -> None:
    ground = Ground(speed=0.0)
    result = outcome(ground.run(Walk().run(ground.context, WalkGoal(1.0))))
    assert (result.stage, result.slot) == ("refused", None)
    assert "The legs, 'almi', do not walk" in result.reason and ground.stages == []


@pytest.mark.parametrize("x", [1e9, 60.0, -1e300])
def test_a_place_that_nobody_can_walk_to_in_time_is_refused(x: float) -> None:
    ground = Ground()
    result = outcome(ground.run(Walk().run(ground.context, WalkGoal(x))))
    assert (result.success, result.stage) == (False, "refused")
    assert "m away; at 0.85 m/s the legs get 51 m within 60 s" in result.reason


@pytest.mark.parametrize("timeout", [-5.0, 0.0, math.nan, math.inf, 1e6])
def test_a_walk_takes_some_time(timeout: float) -> None:
    with pytest.raises(ConfigError, match="timeout"):
        WalkGoal(1.0, timeout=timeout)


@pytest.mark.parametrize("seconds", [-0.1, math.nan, math.inf])
def test_nobody_stands_for_less_than_no_time_or_for_ever(seconds: float) -> None:
    with pytest.raises(ConfigError, match="zero or more seconds"):
        StandGoal(seconds)


def test_it_stands_at_a_height_where_the_legs_take_one() -> None:
    ground = Ground(heights=(0.78, 0.96, 1.0))
    assert outcome(ground.run(Stand().run(ground.context, StandGoal(0.5, 0.8)))).success
    assert ground.twist == Twist(height=0.8) and ground.context.t > 0.5
    drops = ground.context.legs.drops
    assert (drops[0], max(drops), min(drops)) == pytest.approx((-0.16, 0.02, -0.16))
    result = outcome(ground.run(Stand().run(ground.context, StandGoal(0.5, 0.7))))
    assert result.stage == "refused" and "take heights from 0.78 to 1 m, not 0.7 m" in result.reason
    ground = Ground()
    result = outcome(ground.run(Stand().run(ground.context, StandGoal(0.5, 0.8))))
    assert "The legs, 'almi', take no height, not 0.8 m" in result.reason and ground.context.legs.drops == (0.0,)
