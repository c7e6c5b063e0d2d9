"""What is wrong with a robot is named by the check that measures it; the robot here obeys at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from numpy.typing import NDArray

from golem.evaluation.conformance.base import FAILED, SKIPPED, Candidate, Report
from golem.evaluation.conformance.examine import run_suite
from golem.evaluation.conformance.robot_measures import RobotMeasures, floor_normal, rotated, up_in_base
from golem.evaluation.conformance.robot_rig import Path, RobotRig
from golem.evaluation.conformance.still_robot import StillRobot
from golem.hardware.servo.gravity import Gravity
from golem.robots.model.imu_mount import TORSO
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.table import JOINT_INDEX
from golem.robots.sensors.cameras import CAMERAS, HEAD, project
from golem.runtime.lockstep import start_posture
from golem.types import TICK, Array, HandState, Imu, LowState, Side

Change = Callable[[LowState], LowState]


class ObedientRig(RobotRig):
    """A robot that is where it is sent; `change` spoils what it reports, `scale` its depth, `tilt` its LiDAR."""

    def __init__(self) -> None:
        self.cameras, self.calibration = CAMERAS, {name: np.eye(4) for name in CAMERAS}
        self.change: Change = lambda state: state
        self.scale, self.tilt, self.grip_scale, self.slow = 1.0, 0.0, 1.0, 0.0
        self.q = start_posture()
        self._gravity = Gravity()

    def follow(self, path: Path, seconds: float) -> list[LowState]:
        states = []
        for i in range(round(seconds / TICK) + 1):
            before = self.q
            self.q = path(max(0.0, i * TICK - self.slow))
            states.append(self._reported(i * TICK, (self.q - before) / TICK))
        return states

    def rest(self, seconds: float) -> list[LowState]:
        q = self.q.copy()
        return self.follow(lambda t: q, seconds)

    def _reported(self, t: float, dq: Array) -> LowState:
        yaw = self.q[TORSO]
        quat = np.array([np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)])
        imu = Imu(quat, np.array([0.0, 0.0, dq[TORSO]]), np.array([0.0, 0.0, 9.81]))
        tau = self._gravity.torque(self.q, quat).copy()
        return self.change(LowState(t, self.q.copy(), dq, tau, imu))

    def grip(self, side: Side, gap: float, force: float, seconds: float) -> HandState:
        pressed = self.grip_scale * force if gap == 0.0 else 0.0
        return HandState(0.0, gap, np.full(2, 0.5 * gap), np.full(2, pressed))

    def picture(self, camera: str) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        depth = np.full((HEAD.height, HEAD.width), 2.0, np.float32)
        kinematics = Kinematics()
        kinematics.update(self.q)
        T = np.linalg.inv(kinematics.pose("head_camera_optical"))
        ends = [kinematics.pose(f"right_{name}")[:3, 3] for name in ("wrist_yaw_link", "gripper")]
        for share in np.linspace(0.0, 1.0, 40):
            point = T[:3, :3] @ (ends[0] + share * (ends[1] - ends[0])) + T[:3, 3]
            u, v = np.round(project(HEAD, point)).astype(int)
            depth[v - 12 : v + 13, u - 12 : u + 13] = point[2] - 0.03
        return np.zeros((HEAD.height, HEAD.width, 3), np.uint8), depth * np.float32(self.scale)

    def scan(self) -> NDArray[np.float32]:
        kinematics = Kinematics()
        kinematics.update(self.q)
        T = np.linalg.inv(kinematics.pose("lidar_link"))
        x, y = np.meshgrid(np.linspace(-3.0, 3.0, 40), np.linspace(-3.0, 3.0, 40))
        floor = np.stack([x.ravel(), y.ravel(), -1.0 + np.tan(self.tilt) * x.ravel()], axis=1)
        return (floor @ T[:3, :3].T + T[:3, 3]).astype(np.float32)


class Measures(RobotMeasures):
    def __init__(self, rig: RobotRig) -> None:
        self._rig = rig

    @contextmanager
    def rig(self, candidate: Candidate) -> Iterator[RobotRig]:
        yield self._rig


def measured(rig: RobotRig) -> Report:
    return run_suite(Measures(rig), Candidate("robot", "mine", lambda: rig), lambda check: None)


def failures(rig: RobotRig) -> dict[str, str]:
    return {f.check: f.reason for f in measured(rig).findings if f.status == FAILED}


def _swapped(state: LowState) -> LowState:
    q = state.q.copy()
    a, b = JOINT_INDEX["left_hip_pitch_joint"], JOINT_INDEX["right_hip_pitch_joint"]
    q[[a, b]] = q[[b, a]]
    return LowState(state.t, q, state.dq, state.tau, state.imu)


def _flipped(state: LowState) -> LowState:
    q = state.q.copy()
    q[JOINT_INDEX["left_wrist_roll_joint"]] *= -1.0
    return LowState(state.t, q, state.dq, state.tau, state.imu)


def _heavy(state: LowState) -> LowState:
    return LowState(state.t, state.q, state.dq, 1.2 * state.tau, state.imu)


def _xyzw(state: LowState) -> LowState:
    imu = Imu(np.roll(state.imu.quat, -1), state.imu.gyro, state.imu.acc)
    return LowState(state.t, state.q, state.dq, state.tau, imu)


def _falls_freely(state: LowState) -> LowState:
    return LowState(state.t, state.q, state.dq, state.tau, Imu(state.imu.quat, state.imu.gyro, 0.1 * state.imu.acc))


def _backward(state: LowState) -> LowState:
    return LowState(state.t, state.q, state.dq, state.tau, Imu(state.imu.quat, -state.imu.gyro, state.imu.acc))


def test_a_robot_that_does_as_it_is_told_keeps_every_promise() -> None:
    report = measured(ObedientRig())
    assert not report.failed, [(f.check, f.reason) for f in report.failed]
    torque = next(f for f in report.findings if f.check == "torque_is_gravity")
    assert torque.figures["relative error [1]"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "check", "words"),
    [
        (_swapped, "each_joint_moves_alone", "left_hip_pitch_joint was sent by"),
        (_flipped, "each_joint_moves_alone", "left_wrist_roll_joint was sent by"),
        (_heavy, "torque_is_gravity", "20.0 % of another torque"),
        (_falls_freely, "imu_feels_gravity", "feels 0.98 m/s^2"),
        (_backward, "imu_turns_with_the_torso", "the gyroscope says"),
        (_xyzw, "imu_turns_with_the_torso", "its orientation by"),
    ],
)
def test_what_it_reports_wrongly_is_named(change: Change, check: str, words: str) -> None:
    rig = ObedientRig()
    rig.change = change
    found = failures(rig)
    assert words in found.get(check, ""), found


@pytest.mark.parametrize(
    ("spoil", "check"),
    [
        ({"scale": 1.3}, "head_camera_measures_the_arm"),
        ({"scale": 0.001}, "head_camera_measures_the_arm"),
        ({"tilt": 0.1}, "lidar_sees_the_floor_level"),
        ({"grip_scale": 0.5}, "hands_go_where_they_are_sent"),
        ({"slow": 0.4}, "answers_a_step"),
    ],
)
def test_a_wrong_device_is_named(spoil: dict[str, float], check: str) -> None:
    rig = ObedientRig()
    for name, value in spoil.items():
        setattr(rig, name, value)
    assert check in failures(rig)


def test_a_robot_that_no_command_moves_is_not_asked_to_move() -> None:
    report = measured(RobotRig(StillRobot(), start_posture()))
    skipped = {f.check: f.reason for f in report.findings if f.status == SKIPPED}
    assert "no physics" in skipped["answers_a_step"] and "LiDAR" in skipped["lidar_sees_the_floor_level"]
    assert not report.failed


def test_up_and_the_floor() -> None:
    quat = np.array([np.cos(0.1), 0.0, np.sin(0.1), 0.0])  # pitched by 0.2 rad, nose down
    np.testing.assert_allclose(rotated(quat), [np.sin(0.2), 0.0, np.cos(0.2)], atol=1e-12)
    np.testing.assert_allclose(rotated(quat, inverse=True), [-np.sin(0.2), 0.0, np.cos(0.2)], atol=1e-12)
    rig = ObedientRig()
    kinematics = Kinematics()
    kinematics.update(rig.q)
    np.testing.assert_allclose(up_in_base(rig.rest(TICK)[-1], kinematics), [0.0, 0.0, 1.0], atol=1e-9)
    assert np.isnan(floor_normal(np.zeros((3, 3)), np.array([0.0, 0.0, 1.0]))[0]).all()
