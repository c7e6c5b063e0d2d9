from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from golem.capabilities.policies.observer import resized
from golem.capabilities.policies.openpi import PolicyLinkConfig
from golem.capabilities.policies.stream import ActionStream
from golem.capabilities.policies.vectors import (
    ACTION,
    STATE,
    ActionRefused,
    Instant,
    Vectors,
    check_actions,
    palm_numbers,
    palm_pose,
)
from golem.errors import ServiceUnavailable
from golem.robots.model.pinocchio_model import Kinematics
from golem.types import BaseEstimate, HandCommand, HandState, Imu, LowCommand, LowState, Twist

IMU = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.zeros(3))


def test_every_number_is_where_its_name_says() -> None:
    q = 0.01 * np.arange(27.0)
    T = np.eye(4)
    T[:3, :3] = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    base = BaseEstimate(0.0, T, np.array([0.0, 0.5, 0.0]), 0.9)
    hand = HandState(0.0, 0.04, np.array([0.02, 0.02]), np.array([1.0, 2.0]))
    full = {name: np.zeros(27) for name in ("dq", "tau", "kd")}
    command = LowCommand(0.0, q + 0.1, kp=np.where(np.arange(27) == 3, 0.0, 50.0), **full)
    now = Instant(
        LowState(0.0, q, -q, np.zeros(27), IMU), base, {"right": hand}, command,
        {"left": HandCommand(0.0, 0.0, 3.0)}, Twist(0.1, 0.2, 0.3, math.nan),
    )  # fmt: skip
    vectors, kinematics = Vectors(), Kinematics()
    state = dict(zip(STATE, vectors.state(now), strict=True))
    assert state["left_hip_yaw.pos"] == 0.0 and state["right_wrist_yaw.pos"] == pytest.approx(0.26)
    assert state["right_wrist_yaw.vel"] == pytest.approx(-0.26)
    assert (state["right_hand.gap"], state["right_hand.force_b"], state["left_hand.gap"]) == (0.04, 2.0, 0.0)
    assert state["base.vx"] == pytest.approx(0.5) and state["base.up_z"] == 1.0 and state["base.height"] == 0.9
    kinematics.update(q)
    assert state["right_palm.x"] == pytest.approx(kinematics.pose("right_gripper")[0, 3])
    action = dict(zip(ACTION, vectors.action(now), strict=True))
    kinematics.update(vectors.targets(now))
    assert action["left_palm.yz"] == pytest.approx(kinematics.pose("left_gripper")[2, 1])
    assert vectors.targets(now)[3] == q[3] and vectors.targets(now)[4] == pytest.approx(q[4] + 0.1)
    assert (action["left_hand.gap"], action["right_hand.gap"]) == (0.0, 0.04)
    assert (action["base.wz"], action["base.height"]) == (0.3, 0.0)
    assert action["torso.pos"] == pytest.approx(0.22)


def test_a_palm_is_nine_numbers_and_comes_back() -> None:
    T = np.eye(4)
    T[:3, :3] = ((0.6, 0.8, 0.0), (0.8, -0.6, 0.0), (0.0, 0.0, -1.0))
    T[:3, 3] = (0.4, -0.1, 0.2)
    numbers = palm_numbers(T)
    np.testing.assert_allclose(palm_pose(numbers), T, atol=1e-12)
    rough = numbers + 0.05 * np.sin(np.arange(9))
    R = palm_pose(rough)[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    for bad in (np.full(9, np.nan), np.zeros(9), np.array([0, 0, 0, 1, 0, 0, 2, 0, 0.0])):
        with pytest.raises(ActionRefused):
            palm_pose(bad)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (np.zeros((2, 7)), r"shape \(2, 7\)"),
        (np.zeros((0, 25)), "shape"),
        (np.zeros((1, 2, 25)), "shape"),
        (np.full((1, 25), np.nan), "NaN"),
        ("left", "no array"),
        ([[1.0], [1.0, 2.0]], "no array"),
    ],
)
def test_actions_that_are_none(value: Any, words: str) -> None:
    with pytest.raises(ActionRefused, match=words):
        check_actions(value)


class Counting:
    """Answers with chunks whose first number counts the answers, the second the actions."""

    def __init__(self, length: int = 10) -> None:
        self.asked, self.length = 0, length

    def infer(self, observation: Any) -> Any:
        out = np.zeros((self.length, 25))
        out[:, 0], out[:, 1] = self.asked, np.arange(self.length)
        self.asked += 1
        return out


def times(stream: ActionStream, seconds: float) -> list[tuple[float, float, float]]:
    """Return when which action of which chunk is given, 100 times a second."""
    out: list[tuple[float, float, float]] = []
    for k in range(round(100 * seconds)):
        action = stream.step(k / 100, lambda: {}, live=False)
        if action is not None:
            out.append((k / 100, action[0], action[1]))
    return out


def test_the_latency_is_charged() -> None:
    given = times(ActionStream(Counting(), PolicyLinkConfig(fps=10, n_action_steps=5, latency=0.2)), 1.5)
    assert given[0] == (0.2, 0.0, 2.0)  # asked at 0: the first two are over
    assert (0.5, 0.0, 5.0) in given  # the next observation goes out, and the old ones go on
    assert (0.69, 0.0, 6.0) in given and (0.7, 1.0, 2.0) in given


def test_without_latency_the_first_action_is_the_first() -> None:
    given = times(ActionStream(Counting(), PolicyLinkConfig(fps=10, n_action_steps=5, latency=0.0)), 0.6)
    assert given[0] == (0.0, 0.0, 0.0) and (0.49, 0.0, 4.0) in given and (0.5, 1.0, 0.0) in given


def test_a_chunk_that_is_over_holds_its_last_action() -> None:
    given = times(ActionStream(Counting(3), PolicyLinkConfig(fps=10, n_action_steps=8, latency=1.0)), 1.2)
    assert given[0] == (1.0, 0.0, 2.0) and given[-1][2] == 2.0


def test_live_nobody_waits_and_who_is_late_is_given_up() -> None:
    import threading

    go = threading.Event()

    class Slow(Counting):
        def infer(self, observation: Any) -> Any:
            go.wait(5.0)
            return super().infer(observation)

    stream = ActionStream(Slow(), PolicyLinkConfig(timeout=0.5))
    assert stream.step(0.0, lambda: {}, live=True) is None
    assert stream.step(0.3, lambda: {}, live=True) is None
    with pytest.raises(ServiceUnavailable, match="0.5 s"):
        stream.step(0.6, lambda: {}, live=True)
    go.set()
    stream.close()


def test_a_base_stops_while_the_answer_is_late_and_hands_stay_where_they_are_sent() -> None:
    import threading

    go = threading.Event()

    class Walking(Counting):
        def infer(self, observation: Any) -> Any:
            if self.asked:
                go.wait(5.0)
            return super().infer(observation) + 0.3 * (np.arange(25) == list(ACTION).index("base.vx"))

    stream = ActionStream(Walking(8), PolicyLinkConfig(fps=10, n_action_steps=8, latency=0.0))
    assert stream.step(0.0, lambda: {}, live=False) is not None
    walked = {t: stream.step(t, lambda: {}, live=True) for t in (0.8, 1.2, 1.4, 4.0)}  # asked at 0.8, never answered
    go.set()
    stream.close()
    assert [x[21] for x in walked.values() if x is not None] == [0.3, 0.3, 0.0, 0.0]
    assert [x[1] for x in walked.values() if x is not None] == [7.0] * 4


@pytest.mark.parametrize("size", [(320, 240), (160, 120), (224, 168)])
def test_a_smaller_depth_is_where_its_colour_is(size: tuple[int, int]) -> None:
    """Colour is a mean over what becomes one pixel, so depth is from its middle, and none is made up."""
    columns, rows = np.meshgrid(np.arange(640.0, dtype=np.float32), np.arange(480.0, dtype=np.float32))
    for picture in (columns, rows):
        colour, depth = resized(picture, size), resized(picture, size, smooth=False)
        assert abs(float((depth - colour).mean())) <= 0.5
        assert set(np.unique(depth)) <= set(np.unique(picture))
