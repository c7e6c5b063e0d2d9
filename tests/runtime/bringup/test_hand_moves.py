"""A joint that was moved by hand is found, with its sign; and what is wrong with it is said."""

from __future__ import annotations

import numpy as np
import pytest

from golem.robots.model.table import JOINT_INDEX, JOINT_NAMES, load_limits
from golem.runtime.bringup.bringup_command import hand_move, motion_words, wrong_with
from golem.types import NUM_JOINTS, TICK, Imu, LowState

IMU = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))


def moved(joint: int, angle: float, also: float = 0.0, speed: float = 1.0) -> list[LowState]:
    """Return the states of a motion in which another joint moves by `also`; speeds are `speed` times the true ones."""
    steps, states = 100, []
    for k in range(steps + 1):
        q, dq = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)
        q[joint], q[(joint + 5) % NUM_JOINTS] = angle * k / steps, also * k / steps
        dq[joint] = speed * angle / (steps * TICK)
        states.append(LowState(k * TICK, q, dq, np.zeros(NUM_JOINTS), IMU))
    return states


@pytest.mark.parametrize("joint", [0, 11, 12, 26])
@pytest.mark.parametrize("angle", [0.2, -0.2])
def test_the_joint_that_moved_is_found(joint: int, angle: float) -> None:
    found = hand_move(moved(joint, angle, also=0.05), np.zeros(NUM_JOINTS))
    assert found is not None and found.joint == joint
    assert found.angle == pytest.approx(angle) and found.integral == pytest.approx(angle, rel=0.02)
    assert wrong_with(found, joint, angle > 0.0, JOINT_NAMES) == ""


@pytest.mark.parametrize(("angle", "also"), [(0.1, 0.0), (0.2, 0.15), (0.0, 0.0)])
def test_a_joint_that_hardly_moved_or_not_alone_is_none(angle: float, also: float) -> None:
    assert hand_move(moved(3, angle, also), np.zeros(NUM_JOINTS)) is None


def test_order_sign_and_speed_are_told_apart() -> None:
    start = np.zeros(NUM_JOINTS)
    right = hand_move(moved(7, 0.2), start)
    wrong_speed = hand_move(moved(7, 0.2, speed=-1.0), start)
    assert right is not None and wrong_speed is not None
    assert "order" in wrong_with(right, 1, True, JOINT_NAMES)
    assert "sign" in wrong_with(right, 7, False, JOINT_NAMES)
    assert "speed" in wrong_with(wrong_speed, 7, True, JOINT_NAMES)


@pytest.mark.parametrize(
    ("joint", "words"),
    [
        ("left_hip_pitch_joint", "the left foot goes backward"),
        ("left_knee_joint", "the left foot goes backward"),
        ("left_hip_roll_joint", "the left foot goes to the left"),
        ("right_hip_roll_joint", "the right foot goes to the left"),
        ("left_hip_yaw_joint", "the toes of the left foot goes to the left"),
        ("left_shoulder_roll_joint", "the left hand goes to the left"),
        ("torso_joint", "the chest goes to the left"),
    ],
)
def test_people_are_told_how_a_joint_moves(joint: str, words: str) -> None:
    q = np.zeros(NUM_JOINTS)
    assert motion_words(JOINT_INDEX[joint], q) == words
    assert motion_words(JOINT_INDEX[joint], q, False) != words


def test_every_joint_can_be_moved_by_enough() -> None:
    limits = load_limits()
    assert (0.5 * (limits.upper - limits.lower)).min() > 0.12
