"""Joint trajectories and palm targets share the arms: the newer one counts, and neither makes them jump."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from golem.capabilities.arms.base import NUM_UPPER
from golem.interfaces import topics
from golem.interfaces.payloads import ArmCommand, GateState, GateStatus, JointTrajectory
from golem.middleware.bus import Bus
from golem.runtime.contract_check import ContractCheck
from golem.runtime.lockstep import build
from golem.runtime.nodes import UpperBodyNode
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.stack import Stack
from golem.types import NUM_JOINTS, UPPER, Array, BaseEstimate, Imu, LowState, PalmTargets

RATE = 100.0
ZERO = np.zeros(NUM_JOINTS)
STILL = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))


class Drifts:
    """Arms whose joints all go 1 mrad a tick while a hand has a target."""

    rate, latency = RATE, 0.0

    def __init__(self) -> None:
        self.q = np.zeros(NUM_UPPER)
        self.resets: list[Array] = []

    def reset(self, q: Array) -> None:
        self.q = q[UPPER].copy()
        self.resets.append(self.q)

    def step(self, targets_left: Array | None, targets_right: Array | None, q_measured: Array, dt: float) -> ArmCommand:
        if targets_left is not None or targets_right is not None:
            self.q = self.q + 0.001
        return ArmCommand(self.q, np.zeros(2), np.zeros(2), False)


class Rig:
    """A node around such arms, under a gate that lets commands through."""

    def __init__(self) -> None:
        self.bus, self.arms, self.t = Bus(), Drifts(), 0.0
        self.node = UpperBodyNode(self.bus, self.arms, ContractCheck("upper_body", "mine.py:Mine"))
        self.measured = np.zeros(NUM_JOINTS)
        self.bus.publish(topics.BASE, BaseEstimate(0.0, np.eye(4)), 0.0)
        self.gate(GateState.ACTIVE)

    def gate(self, state: GateState) -> None:
        self.bus.publish(topics.SAFETY, GateStatus(self.t, state), self.t)

    def palms(self, T: Array | None = None) -> None:
        self.bus.publish(topics.PALM_TARGETS, PalmTargets(self.t, None, T), self.t)

    def follow(self, times: list[float], offsets: list[float]) -> None:
        q = np.array(offsets)[:, None] * np.ones(NUM_UPPER)
        self.bus.publish(topics.ARM_TRAJECTORY, JointTrajectory(self.t, np.array(times), q), self.t)

    def ticks(self, count: int) -> list[float]:
        """Return the target of the first joint at each tick [mrad]."""
        told: list[float] = []
        for _ in range(count):
            self.t += 1.0 / RATE
            state = LowState(self.t, self.measured, ZERO, ZERO, STILL)
            self.bus.publish(topics.LOW_STATE, state, self.t)
            self.node.step(self.t)
            command = self.bus.latest(topics.ARM_COMMAND)
            assert command is not None
            told.append(round(1e3 * float(command.q[0]), 6))
        return told


def test_a_trajectory_goes_on_from_where_the_controller_had_the_arms_and_back() -> None:
    rig = Rig()
    rig.ticks(1)
    rig.palms(np.eye(4))
    assert rig.ticks(3) == [1.0, 2.0, 3.0]
    rig.follow([0.02, 0.04], [0.005, 0.009])
    assert rig.ticks(6) == [4.0, 5.0, 7.0, 9.0, 9.0, 9.0]
    rig.palms(np.eye(4))
    assert rig.ticks(2) == [10.0, 11.0]
    assert len(rig.arms.resets) == 1


def test_palm_targets_of_the_same_tick_are_older_and_later_ones_newer() -> None:
    rig = Rig()
    rig.ticks(1)
    rig.palms(np.eye(4))
    rig.follow([0.02], [0.01])
    assert rig.ticks(1) == [5.0]
    rig.palms()
    assert rig.ticks(2) == [5.0, 5.0]


def test_one_that_is_given_up_leaves_the_arms_where_they_are() -> None:
    rig = Rig()
    rig.ticks(1)
    rig.follow([0.1], [0.01])
    assert rig.ticks(4)[-1] == 4.0
    rig.follow([], [])
    assert rig.ticks(3) == [4.0, 4.0, 4.0]


def test_one_from_before_a_stop_is_void() -> None:
    rig = Rig()
    rig.ticks(1)
    rig.follow([0.1], [0.01])
    rig.ticks(4)
    rig.measured = np.full(NUM_JOINTS, 0.002)
    rig.gate(GateState.STOP1)
    assert rig.ticks(2) == [2.0, 2.0]
    rig.gate(GateState.ACTIVE)
    assert rig.ticks(2) == [2.0, 2.0]
    rig.follow([0.02], [0.004])
    assert rig.ticks(2) == [3.0, 4.0]


class Waves:
    """Opens both elbows by a joint trajectory, then raises the right hand by 2 cm."""

    def __init__(self) -> None:
        self.goal: Array = np.zeros(NUM_UPPER)
        self.off = [np.inf, np.inf]

    async def run(self, context: Context, goal: float) -> SkillResult:
        self.goal = context.joints.copy()
        self.goal[[4, 11]] -= 0.3
        points = np.array([context.joints, self.goal])
        self.off[0] = await context.follow(np.array([0.1, 1.1]), points, np.zeros((2, NUM_UPPER)))
        arm = context.arms["right"]
        raised = arm.pose.copy()
        raised[2, 3] += 0.02
        await arm.move(raised, 0.05)
        self.off[1] = await arm.settle(0.005, 2.0)
        return SkillResult(True, "done", None, "Waved.")


@pytest.mark.parametrize("wait", [0.0, 0.5])
def test_a_skill_moves_by_joints_then_by_the_hand_in_the_simulator(wait: float) -> None:
    """Also when it is the first thing that happens, before the safety gate has opened."""
    running, robot = build(Stack(profile="ideal"), seed=0)
    try:
        running.executor.run(wait)
        skill = Waves()
        run = running.start(skill, 0.0)
        running.executor.run(6.0, lambda: run.result is not None)
        assert run.result is not None and run.result.success, run.result
        assert skill.off[0] < 0.05 and skill.off[1] < 0.006
    finally:
        robot.close()


def test_a_skill_that_asks_for_the_impossible_is_told_so_and_moves_nothing() -> None:
    class Asks(Waves):
        async def run(self, context: Context, goal: float) -> SkillResult:
            await context.follow(np.array([0.1]), np.full((1, NUM_UPPER), 9.0))
            raise AssertionError

    running, robot = build(Stack(profile="ideal"), seed=0)
    try:
        running.executor.run(0.1)
        run: Any = running.start(Asks(), 0.0)
        running.executor.run(0.2)
        assert run.result.stage == "fault"
        assert "torso_joint is sent to 9 rad; possible: -2.12 to 2.12 rad." in run.result.reason
        assert running.bus.latest(topics.ARM_TRAJECTORY) is None
    finally:
        robot.close()


def test_a_cancelled_skill_leaves_the_arms_where_they_are() -> None:
    running, robot = build(Stack(profile="ideal"), seed=0)
    try:
        running.executor.run(0.5)
        skill = Waves()
        run = running.start(skill, 0.0)
        running.executor.run(1.0)
        run.cancel()
        before = commanded(running)
        running.executor.run(1.5)
        assert np.abs(commanded(running) - before).max() < 0.005
        assert before[4] > skill.goal[4] + 0.1
    finally:
        robot.close()


def commanded(running: Any) -> Array:
    return running.bus.latest(topics.ARM_COMMAND).q
