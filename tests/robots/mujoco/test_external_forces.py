"""Pushes: the force asked for, where it was asked for, on top of what holds the robot, until it is ended."""

from __future__ import annotations

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, Array, LowCommand

TICK = 0.002
ZERO = np.zeros(NUM_JOINTS)


@pytest.fixture
def robot() -> MujocoRobot:
    """An ideal twin in the hoist, in the empty hall."""
    return MujocoRobot("ideal", 0, start_posture(), MujocoConfig(world="open"))


def run(robot: MujocoRobot, seconds: float) -> Array:
    """Hold still for a while; returns the pelvis' position at the end."""
    command = LowCommand(0.0, start_posture(), ZERO, ZERO, np.full(NUM_JOINTS, 800.0), np.full(NUM_JOINTS, 20.0))
    for _ in range(round(seconds / TICK)):
        robot.advance(command, {}, TICK)
    return robot.truth.base().T_world_base[:3, 3]


@pytest.mark.parametrize("axis", [0, 1])
def test_a_push_adds_to_what_the_hoist_does_until_it_is_ended(axis: int, robot: MujocoRobot) -> None:
    rest = run(robot, 2.0)
    force = np.zeros(3)
    force[axis] = 80.0
    robot.push(force)
    moved = run(robot, 2.0) - rest
    assert moved[axis] == pytest.approx(80.0 / robot.config.hoist.stiffness[axis], rel=0.15)
    robot.push(np.zeros(3))
    np.testing.assert_allclose(run(robot, 2.0), rest, atol=2e-4)


def test_impulse_is_force_times_time(robot: MujocoRobot) -> None:
    floating = MujocoRobot("ideal", 0, start_posture(True), MujocoConfig(support="ground", world="open"))
    floating.release()
    model = floating.scene.model
    model.opt.gravity[:] = 0.0
    run(floating, 0.6)  # the band is gone
    mass = float(model.body_subtreemass[model.body("pelvis").id])
    before = floating.truth.com()[1]
    floating.push(np.array([0.0, 100.0, 0.0]), "torso_link")
    run(floating, 0.2)
    floating.push(np.zeros(3), "torso_link")
    run(floating, 0.02)
    assert (floating.truth.com()[1] - before)[1] == pytest.approx(100.0 * 0.2 / mass, rel=0.03)


def test_the_point_of_attack_makes_the_moment(robot: MujocoRobot) -> None:
    force, point = np.array([30.0, 0.0, 0.0]), np.array([0.0, 0.2, 0.1])
    robot.push(force, "torso_link", point)
    run(robot, TICK)
    body = robot.data.body("torso_link")
    wrench = np.zeros(6)
    wrench[:] = robot.data.xfrc_applied[body.id]
    np.testing.assert_allclose(wrench[:3], force)
    lever = body.xpos + body.xmat.reshape(3, 3) @ point - body.xipos
    # The step has moved the body a little since the moment was computed.
    np.testing.assert_allclose(wrench[3:], np.cross(lever, force), atol=0.05)


def test_two_bodies_are_pushed_at_once(robot: MujocoRobot) -> None:
    robot.push(np.array([10.0, 0.0, 0.0]), "left_elbow_link")
    robot.push(np.array([0.0, 20.0, 0.0]), "right_knee_link")
    run(robot, 0.1)
    applied = robot.data.xfrc_applied
    assert applied[robot.data.body("left_elbow_link").id, 0] == 10.0
    assert applied[robot.data.body("right_knee_link").id, 1] == 20.0


def test_an_unpushed_robot_is_what_it_was_before_pushes_existed(robot: MujocoRobot) -> None:
    other = MujocoRobot("ideal", 0, start_posture(), MujocoConfig(world="open"))
    other.push(np.zeros(3), "torso_link")
    for twin in (robot, other):
        run(twin, 0.2)
    np.testing.assert_array_equal(robot.data.qpos, other.data.qpos)


def test_the_caller_may_reuse_its_array(robot: MujocoRobot) -> None:
    force = np.array([25.0, 0.0, 0.0])
    robot.push(force, "torso_link")
    force[:] = 1e6
    run(robot, TICK)
    assert robot.data.xfrc_applied[robot.data.body("torso_link").id, 0] == 25.0


@pytest.mark.parametrize(
    ("force", "body", "words"),
    [
        ([1.0, 0.0, 0.0], "pelvs", "Did you mean 'pelvis'"),
        ([1.0, 0.0, 0.0], "tray", "link to push"),
        ([1.0, 0.0], "pelvis", "three finite"),
        ([np.nan, 0.0, 0.0], "pelvis", "three finite"),
    ],
)
def test_a_push_that_is_none_is_refused(force: list[float], body: str, words: str, robot: MujocoRobot) -> None:
    with pytest.raises(ConfigError, match=words):
        robot.push(np.array(force), body)


def test_forces_are_not_left_behind_in_the_engine(robot: MujocoRobot) -> None:
    robot.push(np.array([10.0, 0.0, 0.0]), "torso_link")
    run(robot, 0.1)
    robot.push(np.zeros(3), "torso_link")
    run(robot, TICK)
    assert not robot.data.xfrc_applied[robot.data.body("torso_link").id].any()
