"""The robot alone in plain MuJoCo: where it starts, what it reports, what a push does, whose model it takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.episodes.plain_episode import PlainRobot, plain_model
from golem.robots.model.table import load_limits
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, LowCommand

POSTURE = start_posture(on_ground=True)


def command(kp: float = 0.0) -> LowCommand:
    """Return a command that pulls every joint to the posture with `kp`."""
    zeros = np.zeros(NUM_JOINTS)
    return LowCommand(0.0, POSTURE, zeros, zeros, np.full(NUM_JOINTS, kp), zeros)


def test_it_reports_the_truth() -> None:
    robot = PlainRobot(None, POSTURE)
    state, base = robot.state(), robot.base()
    np.testing.assert_allclose(state.q, POSTURE)
    np.testing.assert_allclose(base.T_odom_base, np.eye(4), atol=1e-12)
    assert base.height == pytest.approx(robot.truth.base().T_world_base[2, 3], abs=2e-3)
    np.testing.assert_allclose(state.imu.acc, (0.0, 0.0, 9.81), atol=1e-9)
    robot.push(np.array([0.0, 2000.0, 0.0]), "torso_link", None)
    for _ in range(50):
        robot.advance(command())
    state, base, truth = robot.state(), robot.base(), robot.truth.base()
    np.testing.assert_allclose(base.velocity, truth.velocity)
    assert base.T_odom_base[1, 3] == pytest.approx(truth.T_world_base[1, 3])
    # The torso's rate less the waist's is the base's about z.
    assert state.imu.gyro[2] - state.dq[12] == pytest.approx(truth.rate[2])
    assert state.imu.quat[0] < 1.0 and not base.stale


def test_a_push_transfers_its_impulse() -> None:
    robot = PlainRobot(None, POSTURE)
    mass = plain_model().body_subtreemass[0]
    for force in (5000.0, 5000.0, 0.0):  # the last tick is for the centre of mass, which is a step behind
        robot.push(np.array([force, 0.0, 0.0]))
        robot.advance(command())
    assert mass * robot.truth.com()[1][0] == pytest.approx(20.0, rel=0.1)


def test_motors_are_as_strong_as_the_vendor_says() -> None:
    robot = PlainRobot(None, POSTURE + 0.1)
    robot.advance(command(kp=1e6))
    np.testing.assert_allclose(np.abs(robot.state().tau), load_limits().torque)


def test_the_vendors_model_is_taken_as_it_is(shared: Path) -> None:
    folder = shared / "h12" / "vendor" / "unitree_mujoco_h1_2"
    ours, theirs, scene = (plain_model(p) for p in (None, folder / "h1_2_handless.xml", folder / "scene.xml"))
    assert theirs.nu == ours.nu == NUM_JOINTS and theirs.nv == ours.nv
    assert theirs.body_subtreemass[0] == pytest.approx(ours.body_subtreemass[0], rel=2e-3)
    assert theirs.opt.timestep == scene.opt.timestep == 0.002
    assert scene.ngeom == theirs.ngeom  # a scene's own floor is enough


def test_what_is_no_robot_is_refused(tmp_path: Path) -> None:
    (tmp_path / "ball.xml").write_text("<mujoco><worldbody><body name='ball'/></worldbody></mujoco>")
    with pytest.raises(ConfigError, match="is not the robot"):
        plain_model(tmp_path / "ball.xml")
