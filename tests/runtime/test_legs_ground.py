"""A robot on its own feet whose leg controller dies, or whose legs change hands: it stays on its feet."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.runtime.test_lower_body_node import Drive

from golem.interfaces import topics
from golem.interfaces.payloads import GateState
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.walk import StandGoal, WalkGoal
from golem.stack import Choice, load_stack
from golem.types import LEGS, UPPER, Twist

DYING = """
from golem.capabilities.legs.{module} import {name}

class Dying({name}):
    def step(self, state, base, motion, dt):
        if state.t > {end}:
            raise RuntimeError("gone")
        return super().step(state, base, motion, dt)
"""


LOST = """
from dataclasses import replace
from golem.hardware.estimator.random_walk_kf import RandomWalkKF

class Lost(RandomWalkKF):
    def step(self, state, dt):
        return replace(super().step(state, dt), stale=state.t > 4.0)
"""


@contextmanager
def on_open_ground(
    legs: Choice, fallback: str, estimator: Choice | None = None
) -> Iterator[tuple[LockstepRunner, Any]]:
    """A stack on open ground with certain legs, and a certain estimator."""
    stack = load_stack("stand", profile="ideal").with_options("robot", world="open")
    stack = stack.with_choice("lower_body", legs).with_choice("fallback", fallback)
    if estimator is not None:
        stack = stack.with_choice("estimator", estimator)
    running, robot = build(stack, seed=0)
    try:
        yield running, robot
    finally:
        robot.close()


@contextmanager
def standing(path: Path, text: str, fallback: str) -> Iterator[tuple[LockstepRunner, Any]]:
    """The same with legs that are the class `Dying` of `text`."""
    path.write_text(text)
    with on_open_ground(Choice(f"{path}:Dying"), fallback) as both:
        yield both


def assert_it_stands_on(running: LockstepRunner, robot: Any, fallback: str) -> None:
    """Check that the robot stands by its fallback, now and two seconds later."""
    for _ in range(2):
        status = running.bus.latest(topics.LEG_STATUS)
        assert status is not None
        assert (status.controller, status.applied, status.stepping) == (fallback, Twist(), False)
        assert running.safety is not None and running.safety.state is GateState.ACTIVE, running.safety
        assert robot.data.qpos[2] > 0.85
        running.executor.run(running.executor.t + 2.0)


@pytest.mark.slow
def test_legs_that_die_while_they_stand(tmp_path: Path) -> None:
    text = DYING.format(module="wbc", name="Wbc", end=3.0)
    with standing(tmp_path / "dying.py", text, "wbc") as (running, robot):
        result = running.execute("stand", StandGoal(10.0), timeout=12.0)
        assert (result.stage, result.slot) == ("fault", "lower_body")
        assert "Dying failed: RuntimeError: gone" in result.reason
        assert_it_stands_on(running, robot, "wbc")


@pytest.mark.slow
def test_legs_that_die_in_the_middle_of_a_step(tmp_path: Path) -> None:
    text = DYING.format(module="almi", name="Almi", end=4.13)
    with standing(tmp_path / "dying.py", text, "almi") as (running, robot):
        assert running.execute("stand", StandGoal(2.5), timeout=5.0).success
        result = running.execute(Drive(Twist(0.5), seconds=6.0), None, timeout=10.0)
        assert (result.stage, result.slot) == ("fault", "lower_body")
        assert robot.data.qpos[0] > 0.2
        assert_it_stands_on(running, robot, "almi")


@pytest.mark.slow
def test_a_robot_whose_estimate_goes_stale_while_it_walks_is_stood_by_its_gate_which_says_why(tmp_path: Path) -> None:
    path = tmp_path / "lost.py"
    path.write_text(LOST)
    with on_open_ground(Choice("almi"), "almi", Choice(f"{path}:Lost")) as (running, robot):
        assert running.execute("stand", StandGoal(2.5), timeout=5.0).success
        result = running.execute("walk", WalkGoal(2.0, 0.0, frame="base_link", timeout=30.0), timeout=35.0)
        assert (result.success, result.stage, result.slot) == (False, "safety", "safety")
        assert "base_estimate_stale" in result.reason and 4.0 < running.executor.t < 4.6
        running.executor.run(running.executor.t + 3.0)
        assert running.safety is not None and running.safety.state is GateState.STOP2
        command = running.bus.latest(topics.LOW_CMD)
        assert command is not None and (command.kp[LEGS] > 0.0).all() and not command.kp[UPPER].any()
        assert (command.kd > 0.0).all() and robot.data.qpos[2] > 0.85


@pytest.mark.slow
def test_it_walks_with_the_robots_own_controller_and_stands_with_another() -> None:
    """The vendor's has to be brought up first, which takes a second and a half; the robot stands meanwhile."""
    parts = {"walk": {"use": "vendor"}, "stand": {"use": "policy", "options": {"file": "almi_stand"}}}
    with on_open_ground(Choice("handover", parts), "almi") as (running, robot):
        assert running.execute("stand", StandGoal(2.5), timeout=5.0).success
        assert running.execute(Drive(Twist(0.3), seconds=4.0), None, timeout=6.0).success
        assert robot.data.qpos[0] > 0.5
        assert running.execute("stand", StandGoal(3.0), timeout=5.0).success
        stood = robot.data.qpos[:2].copy()
        assert running.execute("stand", StandGoal(2.0), timeout=5.0).success
        assert np.hypot(*(robot.data.qpos[:2] - stood)) < 0.05
        assert_it_stands_on(running, robot, "handover")


@pytest.mark.slow
def test_a_pose_is_reached_with_legs_that_have_no_gait_clock_of_ours() -> None:
    with on_open_ground(Choice("vendor"), "almi") as (running, robot):
        assert running.execute("stand", StandGoal(3.0), timeout=5.0).success
        start = robot.data.qpos[:2].copy()
        result = running.execute("walk", WalkGoal(1.0, 0.0, frame="base_link", timeout=30.0), timeout=35.0)
        assert result.success, result.reason
        assert np.hypot(*(robot.data.qpos[:2] - start)) == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("legs", "load", "within"), [("wbc", 2.0, 0.015), ("mpc", 0.0, 0.03)])
def test_it_squats_and_stands_up_again_with_a_load_in_each_hand(legs: str, load: float, within: float) -> None:
    stack = load_stack("stand", profile="bench").with_options("robot", world="open", payload=[load, load])
    running, robot = build(stack.with_choice("lower_body", legs), seed=0)
    try:
        assert running.execute("stand", StandGoal(3.0), timeout=5.0).success  # the hoist lets go meanwhile
        for goal, height in ((0.8, 0.8), (None, 0.965)):
            result = running.execute("stand", StandGoal(4.0, goal), timeout=15.0)
            assert result.success, result.reason
            assert robot.data.qpos[2] == pytest.approx(height, abs=within)
        assert running.safety is not None and running.safety.state is GateState.ACTIVE
    finally:
        robot.close()
