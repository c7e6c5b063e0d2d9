"""A joint trajectory is met at its points and times, and one that cannot be followed is refused by the joint's name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.capabilities.arms.base import NUM_UPPER, TargetError
from golem.capabilities.arms.trajectory import NEAR, TrajectoryFollower, check_trajectory, gate_limits
from golem.interfaces.payloads import JointTrajectory
from golem.types import Array

DT = 0.01
LOWER, UPPER_LIMIT, SPEED = gate_limits()
MIDDLE: Array = 0.5 * (LOWER + UPPER_LIMIT)


def follow(trajectory: JointTrajectory, q: Array, seconds: float) -> Array:
    """Return the targets (n, 15) at every tick from the beginning of the trajectory on, `q` first."""
    follower = TrajectoryFollower()
    follower.start(trajectory, q)
    steps = [follower.step(trajectory.t + k * DT, DT).q for k in range(1, round(seconds / DT) + 1)]
    return np.array([q, *steps])


def swing(t: float) -> tuple[Array, Array]:
    """Return joints that all swing, and their velocities, at `t` [s]."""
    return MIDDLE + 0.3 * np.sin(t), np.full(NUM_UPPER, 0.3 * np.cos(t))


def test_points_are_met_and_held_at_the_end() -> None:
    times = np.array([0.5, 1.0])
    points = MIDDLE + np.array([[0.2], [-0.1]])
    got = follow(JointTrajectory(7.0, times, points), MIDDLE, 2.0)
    np.testing.assert_allclose(got[50], points[0], atol=1e-12)
    np.testing.assert_allclose(got[100:], np.tile(points[1], (101, 1)), atol=1e-12)
    np.testing.assert_allclose(got[25], MIDDLE + 0.1, atol=1e-12)


def test_with_velocities_a_smooth_motion_is_reproduced() -> None:
    times = np.arange(0.0, 3.01, 0.25)
    points, velocities = (np.array(rows) for rows in zip(*map(swing, times), strict=True))
    got = follow(JointTrajectory(0.0, times, points, velocities), points[0], 3.0)
    true = np.array([swing(k * DT)[0] for k in range(301)])
    # Hermite's error: h^4 / 384 times the fourth derivative.
    assert np.abs(got - true).max() < 0.3 * 0.25**4 / 384 * 1.01


def test_from_a_stand_it_sets_off_at_rest() -> None:
    velocities = np.zeros((1, NUM_UPPER))
    got = follow(JointTrajectory(0.0, np.array([1.0]), MIDDLE[None] + 0.2, velocities), MIDDLE, 1.0) - MIDDLE
    assert got[1].max() == pytest.approx(0.2 * (3 * DT**2 - 2 * DT**3))
    assert got[50] == pytest.approx(np.full(NUM_UPPER, 0.1))


@given(st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=4), st.floats(0.001, 0.3))
def test_whatever_it_is_given_no_limit_is_broken(offsets: list[float], gap: float) -> None:
    times = gap * np.arange(1, len(offsets) + 1)
    points = MIDDLE + np.array(offsets)[:, None]
    got = follow(JointTrajectory(0.0, np.array(times, dtype=np.float64), points), MIDDLE, 1.0)
    assert (np.abs(np.diff(got, axis=0)) <= SPEED * DT + 1e-12).all()
    assert (got >= LOWER).all() and (got <= UPPER_LIMIT).all()


def test_a_command_that_a_limit_held_back_says_so() -> None:
    follower = TrajectoryFollower()
    follower.start(JointTrajectory(0.0, np.array([0.01]), MIDDLE[None] + 0.9), MIDDLE)
    assert follower.step(0.01, DT).limited
    follower.start(JointTrajectory(0.0, np.array([1.0]), MIDDLE[None] + 0.1), MIDDLE)
    assert not follower.step(0.01, DT).limited


def trajectory(**other: Any) -> JointTrajectory:
    return JointTrajectory(**{"t": 0.0, "times": np.array([1.0, 2.0]), "q": np.tile(MIDDLE, (2, 1))} | other)


def off(joint: int, by: float) -> Array:
    points = np.tile(MIDDLE, (2, 1))
    points[1, joint] += by
    return points


def test_a_sound_one_passes() -> None:
    check_trajectory(trajectory(dq=np.zeros((2, NUM_UPPER))), MIDDLE)
    check_trajectory(trajectory(times=np.array([0.0, 1.0])), MIDDLE + 0.9 * NEAR)


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"q": np.zeros((2, 14))}, r"q of a trajectory of 2 points has shape \(2, 14\), not \(2, 15\)"),
        ({"dq": np.zeros((1, 15))}, "dq of a trajectory of 2 points"),
        ({"times": np.array([1.0, 1.0])}, "its times increase"),
        ({"times": np.array([-1.0, 1.0])}, "its times increase"),
        ({"times": np.zeros(0), "q": np.zeros((0, 15))}, "at least one point"),
        ({"times": np.array([1.0, np.nan])}, "its times increase"),
        ({"q": off(3, np.nan)}, "NaN or infinity"),
        ({"q": off(4, 9.0)}, r"left_elbow_joint is sent to \S+ rad; possible: -0.743 to 2.97 rad"),
        (
            {"times": np.array([1.0, 1.001]), "q": off(0, 0.3)},
            r"torso_joint is to move at 300 rad/s; possible: -2.7 to 2.7",
        ),
        ({"dq": np.full((2, 15), 99.0)}, "torso_joint is to move at 99 rad/s"),
        ({"times": np.array([0.0, 1.0]), "q": np.tile(MIDDLE, (2, 1)) + 0.2}, "at once with an offset of 0.2 rad"),
        ({"times": np.array([1e-3, 1.0]), "q": np.tile(MIDDLE, (2, 1)) + 0.2}, "is to move at 200 rad/s"),
    ],
)
def test_one_that_cannot_be_followed_is_refused(other: dict[str, Any], said: str) -> None:
    with pytest.raises(TargetError, match=said):
        check_trajectory(trajectory(**other), MIDDLE)
