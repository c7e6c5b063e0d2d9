"""The LiDAR of the twin: ranges against the walls, the robot's own body, noise, losses, and the IMU inside."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from golem.interfaces.lidar import LidarImu, LidarScan
from golem.native import ORDINARY, new_shared
from golem.robots.model.table import FRAMES
from golem.robots.mujoco.config import MujocoConfig, World
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.lidar_sensor import LATENCY, LidarMoment, LidarSensor
from golem.robots.worlds.furnished import CORRIDOR
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, TICK, LowCommand


def robot(world: World, people: int = 0) -> MujocoRobot:
    config = MujocoConfig(support="ground", world=world, people=people)
    return MujocoRobot("ideal", 0, start_posture(True), config)


def measure(
    twin: MujocoRobot, profile: str, speed: float = 0.0, dropout: float | None = None
) -> tuple[list[LidarScan], list[LidarImu]]:
    """Return 0.2 s of what the sensor says of a robot that glides ahead with `speed`."""
    qvel = twin.data.qvel.copy()
    qvel[:] = 0.0
    qvel[0] = speed
    scans: list[LidarScan] = []
    with closing(LidarSensor(twin.scene, profile, 0, dropout=dropout)) as sensor:
        for k in range(121):
            qpos = twin.data.qpos.copy()
            qpos[0] += speed * 0.002 * k
            sensor.observe(LidarMoment(0.002 * k, qpos, qvel))
            if (scan := sensor.read_scan(0.002 * k)) is not None:
                assert 0.002 * k >= scan.t + LATENCY - 1e-9
                scans.append(scan)
        return scans, sensor.read_imu()


def in_torso(scan: LidarScan) -> np.ndarray:
    T = FRAMES["lidar_link"].T_parent_frame
    return scan.points @ T[:3, :3].T + T[:3, 3]


def test_the_walls_of_the_corridor_are_where_they_are() -> None:
    (scan, _), _ = measure(robot("corridor"), "ideal")
    y = in_torso(scan)[:, 1]
    wall = np.abs(np.abs(y) - CORRIDOR[1] / 2) < 1e-3
    assert 0.3 < wall.mean() < 0.9
    assert np.abs(y).max() < CORRIDOR[1] / 2 + 1e-3


def test_the_points_of_a_moving_robot_are_smeared_by_its_motion() -> None:
    twin = robot("furnished")
    (still, _), _ = measure(twin, "ideal")
    (moving, _), _ = measure(twin, "ideal", speed=1.0)
    # The last points of a scan look back: the wall behind is farther by the way gone until then.
    back_still, back_moving = in_torso(still)[-1000:], in_torso(moving)[-1000:]
    assert back_still[:, 0].min() - back_moving[:, 0].min() == pytest.approx(0.1, abs=0.02)


def test_some_points_are_on_the_robot_itself() -> None:
    (scan, _), _ = measure(robot("corridor"), "ideal")
    p = in_torso(scan)
    assert 0.01 < ((np.abs(p[:, 0]) < 0.6) & (np.abs(p[:, 1]) < 0.5) & (p[:, 2] > -0.6)).mean() < 0.5


def test_losses_and_noise_come_from_the_seed() -> None:
    twin = robot("furnished", people=2)
    (first, _), imu = measure(twin, "field", dropout=0.3)
    (again, _), imu_again = measure(twin, "field", dropout=0.3)
    (whole, _), _ = measure(twin, "field", dropout=0.0)
    assert np.array_equal(first.points, again.points)
    assert all(np.array_equal(a.acc, b.acc) for a, b in zip(imu, imu_again, strict=True))
    assert len(first.points) == pytest.approx(0.7 * len(whole.points), rel=0.03)


def test_the_imu_feels_gravity_upside_down() -> None:
    _, imu = measure(robot("corridor"), "ideal", speed=0.5)
    R = FRAMES["lidar_link"].T_parent_frame[:3, :3]
    assert len(imu) > 40
    for sample in imu:
        assert np.allclose(R @ sample.acc, [0.0, 0.0, 9.81], atol=1e-6)
        assert np.allclose(sample.gyro, 0.0, atol=1e-9)


def test_people_walk_and_are_seen() -> None:
    twin = robot("furnished", people=3)
    before = twin.data.mocap_pos.copy()
    twin.data.time = 1.0
    twin.scene.move_people(twin.data)
    assert (np.linalg.norm(twin.data.mocap_pos - before, axis=1) > 0.05).any()
    (with_people, _), _ = measure(twin, "ideal")
    (without, _), _ = measure(robot("furnished"), "ideal")
    n = min(len(with_people.points), len(without.points))
    assert n and not np.array_equal(with_people.points[:n], without.points[:n])


@pytest.mark.parametrize("kept", ["by the stage", "by Python", "not at all"])
def test_a_lidar_that_is_read_when_its_imu_has_a_sample_says_the_same(kept: str) -> None:
    often, seldom = robot("corridor"), robot("corridor")
    zero, due, said = np.zeros(NUM_JOINTS), 0.0, ([], [])
    stages = seldom.native(None)
    assert stages is not None
    sense, record = stages[0], new_shared()
    seldom.imu()  # draws the noise that the stage needs
    for k in range(70):
        t = TICK * k
        record["t"] = t
        if kept == "by the stage":
            assert sense.run(record) == ORDINARY
        elif kept == "by Python":
            seldom.keep_moment(t)
        said[0].append(often.lidar(t))
        if kept == "not at all" or t >= due - 1e-9:
            due += seldom.lidar_period
            said[1].append(seldom.lidar(t))
        for twin in (often, seldom):
            twin.advance(LowCommand(t, zero, zero, zero, zero, zero), {}, TICK)
    one, other = ([imu for samples, _ in answers for imu in samples] for answers in said)
    assert len(one) == len(other) > 20
    for a, b in zip(one, other, strict=True):
        assert a.t == b.t and (a.gyro == b.gyro).all() and (a.acc == b.acc).all()
    scans = [[scan.points for _, scan in answers if scan is not None] for answers in said]
    assert len(scans[0]) == 1 and (scans[0][0] == scans[1][0]).all()
    often.close()
    seldom.close()
