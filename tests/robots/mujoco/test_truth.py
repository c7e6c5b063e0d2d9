"""The judge's readings against independent computations."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.robots.model.table import SOLE
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, LowCommand

TICK = 0.002
ZERO = np.zeros(NUM_JOINTS)


def twin(**options: object) -> MujocoRobot:
    config = MujocoConfig(support="ground", world="open", **options)  # pyright: ignore[reportArgumentType]
    return MujocoRobot("ideal", 0, start_posture(True), config)


def run(robot: MujocoRobot, seconds: float, kp: float = 3000.0) -> None:
    kd = np.full(NUM_JOINTS, 40.0 if kp else 0.0)
    command = LowCommand(0.0, start_posture(True), ZERO, ZERO, np.full(NUM_JOINTS, kp), kd)
    for _ in range(round(seconds / TICK)):
        robot.advance(command, {}, TICK)


@pytest.fixture
def falling() -> MujocoRobot:
    """A robot that was let go limp 0.5 s ago and pushed: everything moves."""
    robot = twin()
    robot.release()
    robot.push(np.array([60.0, 40.0, 0.0]))
    run(robot, 0.5, kp=0.0)
    return robot


def test_velocities_are_the_rates_of_the_poses(falling: MujocoRobot) -> None:
    before, com = falling.truth.base(), falling.truth.com()
    run(falling, TICK, kp=0.0)
    after, com_after = falling.truth.base(), falling.truth.com()
    assert np.linalg.norm(after.velocity) > 0.2
    rate = (after.T_world_base[:3, 3] - before.T_world_base[:3, 3]) / TICK
    np.testing.assert_allclose(rate, after.velocity, atol=0.02)
    turn = before.T_world_base[:3, :3].T @ after.T_world_base[:3, :3] / TICK
    np.testing.assert_allclose([turn[2, 1], turn[0, 2], turn[1, 0]], after.rate, atol=0.02)
    np.testing.assert_allclose((com_after[0] - com[0]) / TICK, com[1], atol=0.02)


def test_the_centre_of_mass_is_that_of_all_its_bodies(falling: MujocoRobot) -> None:
    model, data = falling.scene.model, falling.data
    mujoco.mj_forward(model, data)
    mine = model.body_rootid == model.body("pelvis").id
    expected = model.body_mass[mine] @ data.xipos[mine] / model.body_mass[mine].sum()
    np.testing.assert_allclose(falling.truth.com()[0], expected, atol=1e-9)


def test_each_foot_carries_its_share() -> None:
    robot = twin()
    robot.release()
    run(robot, 2.0)
    model = robot.scene.model
    weight = 9.81 * float(model.body_subtreemass[model.body("pelvis").id])
    forces = robot.truth.foot_forces()
    np.testing.assert_allclose(forces.sum(axis=0), [0.0, 0.0, weight], atol=0.02 * weight)
    assert np.all(forces[:, 2] > 0.4 * weight)
    # Pushed to the left, the left foot carries more, and both hold against the push.
    robot.push(np.array([0.0, 30.0, 0.0]))
    run(robot, 1.0)
    pushed = robot.truth.foot_forces()
    assert pushed[0, 2] > forces[0, 2] + 20.0 and pushed[1, 2] < forces[1, 2] - 20.0
    assert pushed[:, 1].sum() == pytest.approx(-30.0, abs=5.0)


def test_a_lifted_foot_feels_nothing() -> None:
    robot = twin()
    assert robot.data.ncon == 8
    lifted = start_posture(True)
    lifted[[7, 9, 10]] = [-0.8, 1.6, -0.8]
    for _ in range(250):
        robot.advance(LowCommand(0.0, lifted, ZERO, ZERO, np.full(27, 400.0), np.full(27, 10.0)), {}, TICK)
    soles, forces = robot.truth.soles(), robot.truth.foot_forces()
    assert soles[1, :, 2].min() > 0.05 and np.abs(soles[0, :, 2]).max() < 0.01
    assert not forces[1].any() and forces[0, 2] > 0.0


def test_odom_is_where_the_base_started(falling: MujocoRobot) -> None:
    T = falling.truth.T_world_odom
    np.testing.assert_array_equal(T[:3, :3], np.eye(3))
    np.testing.assert_allclose(T[:3, 3], [0.0, 0.0, 0.965], atol=0.002)
    now = falling.truth.base().T_world_base
    assert np.linalg.norm(now - T) > 0.05
    pose = falling.truth.pose()
    np.testing.assert_allclose((pose.x, pose.y), now[:2, 3] - T[:2, 3])
    assert pose.yaw == pytest.approx(np.arctan2(now[1, 0], now[0, 0]))


def test_soles_have_the_size_of_a_foot(falling: MujocoRobot) -> None:
    for sole in falling.truth.soles():
        lengths = sorted({round(float(np.linalg.norm(a - b)), 6) for a in sole for b in sole})
        width, length = SOLE.y[1] - SOLE.y[0], SOLE.x[1] - SOLE.x[0]
        np.testing.assert_allclose(lengths, [0.0, width, length, np.hypot(width, length)], atol=1e-5)


def test_a_fall_is_seen_and_a_crouch_is_not() -> None:
    robot = twin()
    assert not robot.truth.fallen() and robot.truth.touches() == ()
    assert robot.truth.fallen(height=0.97)
    robot.release()
    run(robot, 0.3, kp=0.0)
    assert not robot.truth.fallen()
    run(robot, 1.5, kp=0.0)
    assert robot.truth.fallen()
    assert "pelvis" in robot.truth.touches() or len(robot.truth.touches()) > 1
    assert not any("ankle" in name for name in robot.truth.touches())


def test_tilt_alone_is_a_fall() -> None:
    robot = twin()
    robot.data.qpos[3:7] = (np.cos(0.55), 0.0, np.sin(0.55), 0.0)
    assert robot.truth.base().tilt == pytest.approx(1.1)
    assert robot.truth.fallen() and not robot.truth.fallen(tilt=1.2)


def test_a_limb_that_meets_another_does_not_touch_the_world() -> None:
    robot = twin()
    crossed = start_posture(True)
    crossed[[2, 8]] = [-0.4, 0.4]
    for _ in range(200):
        robot.advance(LowCommand(0.0, crossed, ZERO, ZERO, np.full(27, 300.0), np.full(27, 5.0)), {}, TICK)
    geoms = {frozenset(pair) for pair in robot.data.contact.geom.tolist()}
    names = {frozenset(robot.scene.model.geom(g).name for g in pair) for pair in geoms}
    assert any(all(name.startswith(("left_", "right_")) for name in pair) for pair in names)
    assert robot.truth.touches() == ()
