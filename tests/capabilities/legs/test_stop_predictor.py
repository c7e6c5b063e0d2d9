"""Where a robot that steps would come to rest: footprints, and how it stood above them."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.legs.gait_clock import StopPredictor, step_rest
from golem.types import Array, PlanarPose

DT = 0.01
PERIOD = 0.64
FEET = (PlanarPose(0.06, 0.16, 0.0), PlanarPose(0.06, -0.16, 0.0))
"""Of a robot that stands, as seen from base_link."""


def numbers(pose: PlanarPose) -> Array:
    return np.array([pose.x, pose.y, pose.yaw])


class Robot:
    """Feet on the floor and a body above them, put where the test wants them."""

    def __init__(self) -> None:
        self.rest = StopPredictor()
        self.feet = [PlanarPose(1.0, 2.0, 0.5) @ foot for foot in FEET]
        self.base = PlanarPose(1.0, 2.0, 0.5)
        self.phase = 0.0

    def run(self, seconds: float, moving: bool) -> None:
        """Stand, or mark time: the foot in the air is thrown about and lands where it was."""
        for _ in range(round(seconds / DT)):
            self.phase += DT / PERIOD if moving else 0.0
            left_up, right_up = moving and self.phase % 1.0 > 0.55, moving and (self.phase + 0.5) % 1.0 > 0.55
            contact = np.array([not left_up, not right_up], dtype=np.float64)
            astray = PlanarPose(0.1, 0.05, 0.2)
            feet = [foot if c else foot @ astray for foot, c in zip(self.feet, contact, strict=True)]
            step_rest(self.rest.memory[0], numbers(self.base), np.array([*map(numbers, feet)]), contact, moving, DT)


def same(a: PlanarPose, b: PlanarPose, tolerance: float = 1e-3) -> None:
    assert (a.x, a.y, a.yaw) == pytest.approx((b.x, b.y, b.yaw), abs=tolerance)


def test_a_body_that_leans_back_and_turns_comes_to_rest_above_its_feet() -> None:
    robot = Robot()
    robot.run(1.0, moving=False)
    home = robot.base
    robot.base = home @ PlanarPose(-0.03, 0.01, 0.05)
    robot.run(6.0, moving=True)
    same(robot.base @ robot.rest.pose, home)
    robot.run(DT, moving=False)
    same(robot.rest.pose, PlanarPose(0.0, 0.0, 0.0), 0.0)


def test_feet_that_were_set_elsewhere_count_where_they_are() -> None:
    robot = Robot()
    robot.run(1.0, moving=False)
    there = PlanarPose(-1.0, 0.3, 3.0)  # the heading wraps between the feet
    robot.feet = [there @ foot @ PlanarPose(0.0, 0.0, turn) for foot, turn in zip(FEET, (0.2, -0.2), strict=True)]
    robot.base = there @ PlanarPose(0.0, 0.0, -0.04)
    robot.run(6.0, moving=True)
    same(robot.base @ robot.rest.pose, there)


def test_a_robot_that_never_stood_is_taken_to_stay_where_it_is() -> None:
    robot = Robot()
    robot.base = robot.base @ PlanarPose(-0.03, 0.0, 0.0)
    robot.run(3.0, moving=True)
    same(robot.rest.pose, PlanarPose(0.0, 0.0, 0.0), 0.0)
    robot.run(1.0, moving=False)
    robot.rest.reset()
    robot.run(3.0, moving=True)
    same(robot.rest.pose, PlanarPose(0.0, 0.0, 0.0), 0.0)


def test_one_sway_does_not_move_the_prediction_by_much() -> None:
    robot = Robot()
    robot.run(1.0, moving=False)
    robot.run(1.0, moving=True)
    robot.base = robot.base @ PlanarPose(0.0, 0.02, 0.0)
    robot.run(0.1, moving=True)
    assert abs(robot.rest.pose.y) < 0.004
