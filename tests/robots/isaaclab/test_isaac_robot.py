"""The robot in Isaac Lab does what the one in MuJoCo does; only where an environment with Isaac Lab is."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from golem.options import fill
from golem.robots.isaaclab.isaac_robot import VARIABLE, IsaacLabConfig, IsaacLabRobot
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, TICK, HandCommand, LowCommand

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(900),
    pytest.mark.skipif(VARIABLE not in os.environ, reason=f"{VARIABLE} names no environment with Isaac Lab"),
]
ZERO = np.zeros(NUM_JOINTS)
HANDS = {side: HandCommand(0.0, 0.02, 4.0) for side in ("left", "right")}


def held(q: np.ndarray, kp: float = 300.0, kd: float = 5.0) -> LowCommand:
    return LowCommand(0.0, q, ZERO, ZERO, np.full(NUM_JOINTS, kp), np.full(NUM_JOINTS, kd))


def isaac(**options: Any) -> IsaacLabRobot:
    start = start_posture(options.get("support") == "ground")
    return IsaacLabRobot("ideal", 0, start, fill("option", IsaacLabConfig, options))


def run(robot: MujocoRobot, command: LowCommand, seconds: float, hands: Any = None) -> None:
    for _ in range(round(seconds / TICK)):
        robot.advance(command, hands or {}, TICK)


@pytest.fixture
def hanging() -> Iterator[tuple[MujocoRobot, IsaacLabRobot]]:
    """Return one robot in each engine."""
    robot = isaac()
    yield MujocoRobot("ideal", 0, start_posture(), MujocoConfig(world="open", self_collision=False)), robot
    robot.close()


def test_every_motor_turns_its_own_joint_against_the_same_weight(hanging: tuple[MujocoRobot, IsaacLabRobot]) -> None:
    start = start_posture()
    step = np.where(np.arange(NUM_JOINTS) % 2, 0.1, -0.1) * np.linspace(0.5, 1.0, NUM_JOINTS)
    reports = []
    for robot in hanging:
        run(robot, held(start + step), 1.5, HANDS)
        reports.append(robot.joints())
        assert robot.hand("left", 1.5).gap == pytest.approx(0.02, abs=0.002)
        assert np.linalg.norm(robot.imu().acc) == pytest.approx(9.81, abs=0.1)
    np.testing.assert_allclose(reports[1][0], reports[0][0], atol=0.004)
    np.testing.assert_allclose(reports[1][2], reports[0][2], atol=0.5)
    assert np.abs(reports[1][0] - start).min() > 0.01


def test_it_hangs_for_a_minute_as_in_mujoco(hanging: tuple[MujocoRobot, IsaacLabRobot]) -> None:
    mine, other = hanging
    for _ in range(60):
        for robot in hanging:
            run(robot, held(start_posture()), 1.0)
        np.testing.assert_allclose(other.joints()[0], mine.joints()[0], atol=0.002)
    np.testing.assert_allclose(other.joints()[2], mine.joints()[2], atol=0.05)


def test_it_stands_on_its_soles_with_its_weight_and_the_same_seed_gives_the_same_motion() -> None:
    ends = []
    for _ in range(2):
        robot = isaac(support="ground")
        command = held(start_posture(True), 3000.0, 40.0)
        run(robot, command, 0.5)
        robot.release()
        run(robot, command, 1.5)
        assert not robot.truth.fallen() and robot.truth.touches() == ()
        assert robot.truth.foot_forces()[:, 2].sum() == pytest.approx(67.81 * 9.81, rel=0.05)
        ends.append(robot.data.qpos.copy())
        robot.close()
    np.testing.assert_array_equal(ends[0], ends[1])
