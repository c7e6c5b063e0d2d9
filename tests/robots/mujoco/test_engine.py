"""The twin: SDK order, the errors of the profile where they belong, and the fine step only where it is needed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.base import Robot
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.robots.mujoco import engine
from golem.robots.mujoco.engine import MujocoConfig, MujocoRobot
from golem.robots.mujoco.external_forces import HoistConfig
from golem.robots.mujoco.scene import COARSE_STEP, FINE_STEP
from golem.robots.sensors.profiles import RealismProfile, load_profile
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, Array, HandCommand, LowCommand

TICK = 0.002
ZERO = np.zeros(NUM_JOINTS)


def hold(q: Array, kp: float = 200.0) -> LowCommand:
    """Return a command that holds `q` (27,)."""
    return LowCommand(0.0, q, ZERO, ZERO, np.full(NUM_JOINTS, kp), np.full(NUM_JOINTS, 5.0))


def limp(tau: Array = ZERO) -> LowCommand:
    return LowCommand(0.0, ZERO, ZERO, tau, ZERO, ZERO)


def twin(profile: str = "ideal", seed: int = 0, config: MujocoConfig | None = None) -> MujocoRobot:
    return MujocoRobot(profile, seed, start_posture(), config)


@pytest.fixture
def robot() -> Iterator[MujocoRobot]:
    """An ideal twin in its start posture."""
    made = twin()
    yield made
    made.close()


@pytest.fixture
def with_delay(monkeypatch: pytest.MonkeyPatch) -> MujocoRobot:
    """An ideal twin whose motors get their commands 6 ms late."""
    ideal = load_profile("ideal")

    def delayed(name: str) -> RealismProfile:
        return replace(ideal, actuator_delay=0.006)

    monkeypatch.setattr(engine, "load_profile", delayed)
    return twin()


def test_it_satisfies_the_contract(robot: MujocoRobot) -> None:
    contract: Robot = robot
    q, dq, tau = contract.joints()
    assert q.shape == dq.shape == tau.shape == (NUM_JOINTS,)


def test_it_starts_at_rest_in_the_posture_given(robot: MujocoRobot) -> None:
    q, dq, tau = robot.joints()
    np.testing.assert_array_equal(q, start_posture())
    np.testing.assert_array_equal(dq, ZERO)
    np.testing.assert_array_equal(tau, ZERO)
    assert robot.hand("left", 0.0).gap == pytest.approx(engine.START_GAP)


@pytest.mark.parametrize("joint", range(NUM_JOINTS))
def test_motor_i_turns_joint_i_of_the_sdk(joint: int, robot: MujocoRobot) -> None:
    robot.scene.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    before = robot.data.joint(JOINT_NAMES[joint]).qpos[0]
    target = start_posture()
    middle = load_limits("urdf")
    target[joint] += 0.15 if target[joint] < 0.5 * (middle.lower + middle.upper)[joint] else -0.15
    command = hold(target)
    for _ in range(150):
        robot.advance(command, {}, TICK)
    q, dq, _ = robot.joints()
    moved = q - start_posture()
    assert np.argmax(np.abs(moved)) == joint
    assert moved[joint] * (target - start_posture())[joint] > 0.0
    assert q[joint] == robot.data.joint(JOINT_NAMES[joint]).qpos[0] != before
    assert dq[joint] == robot.data.joint(JOINT_NAMES[joint]).qvel[0]


def test_the_encoders_are_off_by_what_the_episode_drew() -> None:
    field = twin("field")
    q, _, _ = field.joints()
    truth = np.array([field.data.joint(name).qpos[0] for name in JOINT_NAMES])
    np.testing.assert_array_equal(truth, start_posture())
    off = q - truth
    assert np.abs(off).max() > np.radians(0.1)
    np.testing.assert_allclose(off, field._errors.joint_offset, atol=field.profile.motors.encoder_step)


def test_the_motors_servo_what_the_encoders_report() -> None:
    field = twin("field")
    stiff = hold(start_posture(), kp=2000.0)
    for _ in range(400):
        field.advance(stiff, {}, TICK)
    q, _, _ = field.joints()
    offset = field._errors.joint_offset
    largest = int(np.argmax(np.abs(offset[12:]))) + 12
    # The reported angle goes to the target, so the true one is off by the encoder's error.
    truth = field.data.joint(JOINT_NAMES[largest]).qpos[0]
    assert abs(q[largest] - start_posture()[largest]) < 0.25 * abs(offset[largest])
    assert abs(truth - start_posture()[largest]) > 0.75 * abs(offset[largest])


def test_without_delay_a_command_acts_in_its_tick(robot: MujocoRobot) -> None:
    tau = ZERO.copy()
    tau[20] = 3.0
    robot.advance(limp(tau), {}, TICK)
    np.testing.assert_array_equal(robot.joints()[2], tau)


def test_the_actuator_delay_is_exact(with_delay: MujocoRobot) -> None:
    seen: list[float] = []
    for i in range(8):
        tau = ZERO.copy()
        tau[20] = float(i + 1)
        with_delay.advance(limp(tau), {}, TICK)
        seen.append(with_delay.joints()[2][20])
    # Three ticks late; until the first command is old enough it is the oldest there is.
    assert seen == [1.0, 1.0, 1.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_no_motor_gives_more_than_its_limit(robot: MujocoRobot) -> None:
    limit = load_limits("urdf").torque
    for sign in (1.0, -1.0):
        robot.advance(limp(np.full(NUM_JOINTS, sign * 1e4)), {}, TICK)
        np.testing.assert_array_equal(robot.joints()[2], sign * limit)


def test_the_torque_profile_is_an_option() -> None:
    paper = twin(config=MujocoConfig(torque_profile="paper"))
    paper.advance(limp(np.full(NUM_JOINTS, 1e4)), {}, TICK)
    np.testing.assert_array_equal(paper.joints()[2], load_limits("paper").torque)
    with pytest.raises(ConfigError, match="papr"):
        twin(config=MujocoConfig(torque_profile="papr"))


def test_time_passes_as_told(robot: MujocoRobot) -> None:
    for _ in range(50):
        robot.advance(hold(start_posture()), {}, TICK)
    assert robot.data.time == pytest.approx(0.1, abs=1e-12)


def over(robot: MujocoRobot, height: float) -> None:
    """Move the first screw so that the right hand's finger is `height` above it."""
    screw = robot.scene.names.screws[0]
    address = robot.scene.model.joint(screw).qposadr[0]
    finger = robot.data.body("right_a_finger").xpos
    robot.data.qpos[address : address + 3] = finger - (0.0, 0.0, height)
    robot.data.qvel[:] = 0.0
    mujoco.mj_forward(robot.scene.model, robot.data)


@pytest.mark.parametrize(("factor", "step"), [(0.9, FINE_STEP), (1.1, COARSE_STEP)])
def test_physics_is_fine_only_where_a_finger_is_near_a_screw(factor: float, step: float, robot: MujocoRobot) -> None:
    over(robot, factor * robot.config.near)
    robot.advance(hold(start_posture()), {}, TICK)
    assert robot.scene.model.opt.timestep == step


def test_physics_is_fine_while_a_screw_moves(robot: MujocoRobot) -> None:
    robot.advance(hold(start_posture()), {}, TICK)
    assert robot.scene.model.opt.timestep == COARSE_STEP
    robot.data.qvel[robot.scene.model.joint(robot.scene.names.screws[-1]).dofadr[0] + 2] = 0.1
    robot.advance(hold(start_posture()), {}, TICK)
    assert robot.scene.model.opt.timestep == FINE_STEP


def test_screws_rest_in_their_bores(robot: MujocoRobot) -> None:
    start = [robot.data.body(name).xpos.copy() for name in robot.scene.names.screws]
    for _ in range(250):
        robot.advance(hold(start_posture()), {}, TICK)
    for name, was in zip(robot.scene.names.screws, start, strict=True):
        assert np.linalg.norm(robot.data.body(name).xpos - was) < 0.003
    assert robot.scene.model.opt.timestep == COARSE_STEP


def test_the_imu_reads_up_at_rest(robot: MujocoRobot) -> None:
    for _ in range(500):
        robot.advance(hold(start_posture(), kp=400.0), {}, TICK)
    imu = robot.imu()
    np.testing.assert_allclose(imu.acc, [0.0, 0.0, 9.81], atol=0.3)
    assert abs(np.linalg.norm(imu.quat) - 1.0) < 1e-9
    assert np.abs(imu.gyro).max() < 0.05


def test_hands_do_as_they_are_told(robot: MujocoRobot) -> None:
    command = {"left": HandCommand(0.0, 0.02, 4.0), "right": HandCommand(0.0, 0.09, 4.0)}
    for _ in range(500):
        robot.advance(hold(start_posture()), command, TICK)  # pyright: ignore[reportArgumentType]
    assert robot.hand("left", 1.0).gap == pytest.approx(0.02, abs=0.001)
    assert robot.hand("right", 1.0).gap == pytest.approx(0.09, abs=0.001)
    assert robot.hand("right", 1.5).t == 1.5


@pytest.mark.parametrize("camera", ["head", "left_hand", "right_hand"])
def test_a_capture_has_the_cameras_shape(camera: str, robot: MujocoRobot) -> None:
    info = robot.cameras[camera]
    rgb, depth = robot.capture(camera)
    assert (rgb.shape, rgb.dtype) == ((info.height, info.width, 3), np.uint8)
    assert (depth.shape, depth.dtype) == ((info.height, info.width), np.float32)
    valid = depth[depth > 0]
    assert np.isfinite(depth).all()
    if camera == "head":
        assert len(valid) > 0.2 * depth.size
        assert valid.min() >= info.near and valid.max() <= info.far


def test_a_payload_weighs_and_hides_nothing() -> None:
    plain, loaded = twin(), twin(config=MujocoConfig(payload=(1.0, 2.0)))
    np.testing.assert_array_equal(plain.capture("right_hand")[0], loaded.capture("right_hand")[0])
    weight = [float(r.scene.model.body_mass.sum()) for r in (plain, loaded)]
    assert weight[1] - weight[0] == pytest.approx(3.0)
    for robot in (plain, loaded):
        robot.close()


def test_pictures_of_one_moment_differ_by_the_noise_of_the_sensor_alone() -> None:
    robot = twin("field")
    (one, _), (other, _) = robot.capture("head"), robot.capture("head")
    assert 0.5 < np.std(one.astype(float) - other.astype(float)) < 5.0
    robot.close()


def test_what_is_reported_is_not_changed_by_what_comes_after(robot: MujocoRobot) -> None:
    q, dq, tau = robot.joints()
    imu = robot.imu()
    kept = [a.copy() for a in (q, dq, tau, imu.quat, imu.gyro, imu.acc)]
    for _ in range(20):
        robot.advance(limp(), {}, TICK)
    for now, was in zip((q, dq, tau, imu.quat, imu.gyro, imu.acc), kept, strict=True):
        np.testing.assert_array_equal(now, was)


def test_an_ideal_robot_is_calibrated_and_a_field_one_is_not() -> None:
    ideal, field = twin("ideal"), twin("field")
    for name in ideal.cameras:
        np.testing.assert_allclose(ideal.calibration[name], np.eye(4), atol=1e-12)
    assert np.linalg.norm(field.calibration["head"][:3, 3]) > 0.005


def test_the_hoist_height_is_an_option() -> None:
    high = twin(config=MujocoConfig(hoist=HoistConfig(height=1.3)))
    assert high.data.body("pelvis").xpos[2] == pytest.approx(1.3)


def test_an_unknown_profile_is_answered_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"bench, field, ideal.*Did you mean 'field'"):
        twin("feild")
