"""What a skill is promised of its arms, hands and eyes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.skills.conftest import modules

from golem.capabilities.arms.base import TargetError
from golem.interfaces import topics
from golem.interfaces.payloads import DetectionRequest, Detections, Feedback, GripState, HandGoal
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.types import NUM_JOINTS, Array, BaseEstimate, Imu, LowState

DT = 0.01
OK = SkillResult(True, "done", None, "Done.")


class Still(Kinematics):
    """Arms that do not move."""

    def __init__(self) -> None:
        self.T = np.eye(4)

    def update(self, q: Array) -> None:
        self.q = q

    def pose(self, frame: str) -> Array:
        return self.T


def context() -> Context:
    return Context(Bus(), Still(), DT, modules())


def at(*position: float) -> Array:
    T = np.eye(4)
    T[:3, 3] = position
    return T


def positions(context: Context, goal: Callable[[int], Array], ticks: int, v: float, a: float) -> Array:
    """Return where `approach` sent the right arm at each tick, (ticks + 1, 3)."""
    out = [context.arms["right"].commanded[:3, 3].copy()]
    for i in range(ticks):
        context.arms["right"].approach(goal(i), v, a)
        out.append(context.arms["right"].commanded[:3, 3].copy())
    return np.array(out)


point = st.tuples(*[st.floats(-0.3, 0.3)] * 3)


@settings(max_examples=40)
@given(st.lists(point, min_size=1, max_size=6), st.floats(0.02, 0.3), st.floats(0.2, 2.0))
def test_approach_keeps_speed_and_acceleration_whatever_the_goal_does(
    goals: list[tuple[float, ...]], v: float, a: float
) -> None:
    path = positions(context(), lambda i: at(*goals[min(i // 25, len(goals) - 1)]), 25 * len(goals), v, a)
    velocity = np.diff(path, axis=0) / DT
    acceleration = np.diff(np.vstack([np.zeros(3), velocity]), axis=0) / DT
    assert np.linalg.norm(velocity, axis=1).max() <= v * (1 + 1e-9) + 1e-9
    assert np.linalg.norm(acceleration, axis=1).max() <= a * (1 + 1e-6) + 1e-6


@settings(max_examples=15)
@given(point, point, st.floats(0.05, 0.3), st.floats(0.3, 2.0), st.integers(0, 60))
def test_approach_comes_to_rest_at_a_goal_that_rests(
    first: tuple[float, ...], last: tuple[float, ...], v: float, a: float, turn: int
) -> None:
    path = positions(context(), lambda i: at(*(first if i < turn else last)), 2500, v, a)
    assert np.linalg.norm(path[-1] - last) < 1e-5
    assert np.linalg.norm(path[-1] - path[-2]) < 1e-7


@settings(max_examples=25)
@given(point, st.floats(0.05, 0.3), st.floats(0.3, 2.0))
def test_approach_does_not_overshoot(goal: tuple[float, ...], v: float, a: float) -> None:
    path = positions(context(), lambda i: at(*goal), 600, v, a)
    left = np.linalg.norm(path - np.array(goal), axis=1)
    assert (np.diff(left) <= 1e-12).all()


def test_approach_follows_a_goal_that_moves() -> None:
    path = positions(context(), lambda i: at(0.05 * i * DT, 0.0, 0.0), 800, 0.15, 0.6)
    lag = 0.05 * np.arange(800) * DT - path[1:, 0]
    # Three ticks is the time constant at the end: at 5 cm/s it trails by a few millimetres at most.
    assert 0.0 < lag[-1] < 0.006
    assert np.ptp(lag[400:]) < 1e-4


def test_approach_starts_from_rest_after_a_move(world: Any) -> None:
    arm = world.context.arms["right"]

    async def skill() -> SkillResult:
        start = arm.commanded
        goal = start.copy()
        goal[0, 3] += 0.2
        for _ in range(20):
            arm.approach(goal, 0.2)
            await world.context.tick()
        await arm.move(start, 0.2)
        arm.approach(start, 0.2)
        np.testing.assert_allclose(arm.commanded, start, atol=1e-12)
        return OK

    assert world.run(skill()).result is OK


def test_a_line_is_straight_and_ends_at_its_goal(world: Any) -> None:
    arm = world.context.arms["right"]
    start = arm.pose
    goal = start.copy()
    goal[:3, 3] += (0.1, -0.05, 0.2)

    async def skill() -> SkillResult:
        await arm.move(goal, v_max=0.25)
        return OK

    assert world.run(skill()).result is OK
    np.testing.assert_allclose(arm.commanded, goal, atol=1e-12)
    path = np.array([T[:3, 3] for T in world.sent]) - start[:3, 3]
    direction = (goal - start)[:3, 3] / np.linalg.norm((goal - start)[:3, 3])
    assert np.abs(path - np.outer(path @ direction, direction)).max() < 1e-12
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() <= 0.25 * DT * (1 + 1e-9)


def test_a_line_ends_early_when_told(world: Any) -> None:
    arm = world.context.arms["right"]
    goal = arm.pose.copy()
    goal[2, 3] += 0.2

    async def skill() -> SkillResult:
        await arm.move(goal, 0.1, stop=lambda: world.context.t > 0.5)
        return OK

    assert world.run(skill()).result is OK
    assert world.t == pytest.approx(0.51)
    assert 0.02 < arm.commanded[2, 3] - 0.1 < 0.06


def test_settle_returns_what_is_left(world: Any) -> None:
    arm = world.context.arms["right"]
    left: list[float] = []

    async def skill() -> SkillResult:
        await arm.move(arm.commanded, 0.1)
        left.append(await arm.settle(0.001, 0.3))
        world.kinematics.offset = np.array([0.0, 0.004, 0.0])
        left.append(await arm.settle(0.001, 0.3))
        left.append(await arm.settle(0.005, 0.3))
        return OK

    assert world.run(skill()).result is OK
    assert left == pytest.approx([0.0, 0.004, 0.004])
    assert world.t == pytest.approx(0.31, abs=0.02)


@pytest.mark.parametrize("bad", [np.full((4, 4), np.nan), np.zeros((4, 4)), np.eye(3), 2.0 * np.eye(4)])
def test_no_arm_is_sent_to_what_is_no_pose(bad: Array) -> None:
    c = context()
    with pytest.raises((TargetError, IndexError, ValueError)):
        c.arms["right"].approach(bad, 0.1)
    assert c.bus.latest(topics.PALM_TARGETS) is None


def test_an_arm_that_was_never_moved_keeps_its_posture() -> None:
    c = context()
    c.arms["left"].approach(at(0.1, 0.0, 0.0), 0.1)
    targets = c.bus.latest(topics.PALM_TARGETS)
    assert targets is not None and targets.right is None and targets.left is not None


def test_arms_that_are_released_start_from_where_they_are() -> None:
    c = context()
    c.arms["left"].approach(at(0.1, 0.0, 0.0), 0.1)
    c.release_arms()
    c.release_arms()
    targets = c.bus.latest(topics.PALM_TARGETS)
    assert targets is not None and targets.left is None and targets.right is None
    assert c.bus.count(topics.PALM_TARGETS) == 2  # the second time there was nothing to release
    np.testing.assert_array_equal(c.arms["left"].commanded, c.arms["left"].pose)


def test_the_pose_of_a_gripper_is_base_times_kinematics() -> None:
    c = Context(Bus(), Kinematics(), DT, modules())
    T = at(0.01, 0.02, 0.03)
    q = np.zeros(NUM_JOINTS)
    q[12] = 0.5
    imu = Imu(np.array([1.0, 0, 0, 0]), np.zeros(3), np.zeros(3))
    zero = np.zeros(NUM_JOINTS)
    c.bus.publish(topics.LOW_STATE, LowState(0.0, q, zero, zero, imu), 0.0)
    c.bus.publish(topics.BASE, BaseEstimate(0.0, T), 0.0)
    c.refresh(0.0)
    nominal = Kinematics()
    nominal.update(q)
    np.testing.assert_allclose(c.arms["left"].pose, T @ nominal.pose("left_gripper"), atol=1e-12)


def test_an_eye_streams_only_while_it_is_open(world: Any, thing: Any) -> None:
    world.objects["head"] = lambda: [thing("screw", (0.4, 0.0, 0.0), world.t)]
    topic, look = topics.detections("head"), topics.detection_request("head")

    async def skill() -> SkillResult:
        with world.context.watch("head", "screw", "tray") as eye:
            assert world.bus.latest(look) == DetectionRequest(("screw", "tray"))
            got = await eye.look(1.0)
            assert isinstance(got, Detections) and got.objects[0].label == "screw"
            assert eye.fresh() is None
        return OK

    world.run(skill())
    assert world.bus.latest(look) == DetectionRequest()
    count = world.bus.count(topic)
    for _ in range(50):
        world.step()
    assert world.bus.count(topic) == count == 1


def test_an_eye_closes_when_the_skill_fails_or_is_cancelled(world: Any) -> None:
    async def skill() -> SkillResult:
        with world.context.watch("head", "screw"):
            while True:
                await world.context.tick()

    run = world.run(skill(), ticks=3)
    run.cancel()
    assert world.bus.latest(topics.detection_request("head")) == DetectionRequest()


def test_an_eye_does_not_show_a_frame_from_before_it_opened() -> None:
    c = context()
    topic = topics.detections("head")
    c.bus.publish(topic, Detections(0.95, "head", ()), 0.95, latency=0.1)
    c.refresh(1.0)
    with c.watch("head", "screw") as eye:
        c.bus.deliver(1.05)
        assert eye.fresh() is None
        c.bus.publish(topic, Detections(1.02, "head", ()), 1.02)
        fresh = eye.fresh()
        assert fresh is not None and fresh.t == 1.02
        assert eye.fresh() is None


def test_an_eye_gives_up_in_time(world: Any) -> None:
    async def skill() -> SkillResult:
        with world.context.watch("head", "screw") as eye:
            assert await eye.look(0.5) is None
        return OK

    assert world.run(skill()).result is OK
    assert world.t == pytest.approx(0.51, abs=0.011)


def test_a_hand_is_told_and_read(world: Any) -> None:
    hand = world.context.hands["left"]
    with pytest.raises(StageFailed, match="left hand does not report"):
        _ = hand.status
    world.step()
    assert hand.status.state is GripState.OPEN
    hand.open(0.03)
    assert world.bus.latest(topics.hand_goal("left")) == HandGoal(0.03)
    hand.close(5.0)
    assert world.bus.latest(topics.hand_goal("left")) == HandGoal(None, 5.0)
    assert world.bus.latest(topics.hand_goal("right")) is None


def test_sleep_and_until_count_robot_time(world: Any) -> None:
    times: list[float] = []

    async def skill() -> SkillResult:
        c = world.context
        await c.sleep(0.25)
        times.append(c.t)
        assert await c.until(lambda: c.t > 0.4, timeout=1.0)
        times.append(c.t)
        assert not await c.until(lambda: False, timeout=0.2)
        times.append(c.t)
        return OK

    assert world.run(skill()).result is OK
    assert times == pytest.approx([0.26, 0.41, 0.61], abs=0.011)


def test_feedback_carries_skill_stage_text_and_numbers() -> None:
    c = context()
    c.refresh(2.0)
    c.skill = "pick"
    c.say("servo", "Servoing.", target=[1.0, 2.0, 3.0])
    expected = Feedback(2.0, "pick", "servo", "Servoing.", {"target": [1.0, 2.0, 3.0]})
    assert c.bus.latest(topics.FEEDBACK) == expected
