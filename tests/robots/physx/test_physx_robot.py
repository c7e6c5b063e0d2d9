"""The robot in PhysX does what the one in MuJoCo does, as far as engines agree, and refuses what PhysX cannot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.options import fill
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.external_forces import RELEASE_TIME
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, TICK, Array, HandCommand, LowCommand

pytest.importorskip("sapien", reason="PhysX needs the extra 'physx'")

from golem.robots.physx.physx_robot import PhysxConfig, PhysxRobot

ZERO = np.zeros(NUM_JOINTS)


def held(q: Array, kp: float = 300.0, kd: float = 5.0) -> LowCommand:
    return LowCommand(0.0, q, ZERO, ZERO, np.full(NUM_JOINTS, kp), np.full(NUM_JOINTS, kd))


def twins(**options: Any) -> tuple[MujocoRobot, PhysxRobot]:
    """Return one robot in each engine, limbs free to pass through each other in both."""
    ground = options.get("support") == "ground"
    q = start_posture(ground)
    plain = fill("option", MujocoConfig, {"world": "open", **options, "self_collision": False})
    return (MujocoRobot("ideal", 0, q, plain), PhysxRobot("ideal", 0, q, fill("option", PhysxConfig, options)))


def run(robot: MujocoRobot, command: LowCommand, seconds: float, hands: Any = None) -> None:
    for _ in range(round(seconds / TICK)):
        robot.advance(command, hands or {}, TICK)


def test_every_motor_turns_its_own_joint_and_the_same_way() -> None:
    start = start_posture()
    step = np.where(np.arange(NUM_JOINTS) % 2, 0.1, -0.1) * np.linspace(0.5, 1.0, NUM_JOINTS)
    ends: list[Array] = []
    for robot in twins():
        run(robot, held(start + step), 1.5)
        ends.append(robot.joints()[0] - start)
    np.testing.assert_allclose(ends[1], ends[0], atol=0.004)
    assert np.abs(ends[1]).min() > 0.01


def test_motors_carry_the_same_weight() -> None:
    loads: list[Array] = []
    for robot in twins():
        run(robot, held(start_posture()), 1.5)
        loads.append(robot.joints()[2])
    np.testing.assert_allclose(loads[1], loads[0], atol=0.5)
    assert np.abs(loads[1]).max() > 5.0


def test_the_imu_feels_gravity_and_the_bases_turn() -> None:
    for robot in twins():
        run(robot, held(start_posture()), 1.5)
        mean = np.mean([_tick(robot).acc for _ in range(50)], axis=0)
        assert np.linalg.norm(mean) == pytest.approx(9.81, abs=0.05)
    rates: list[Array] = []
    for robot in twins(support="ground"):
        robot.release()
        run(robot, held(start_posture(True), 3000.0, 40.0), RELEASE_TIME + 0.2)
        robot.push(np.array([300.0, 120.0, 0.0]))
        run(robot, held(start_posture(True), 3000.0, 40.0), 0.2)
        rates.append(robot.imu().gyro)
    np.testing.assert_allclose(rates[1], rates[0], atol=0.15)
    assert np.linalg.norm(rates[1]) > 0.3


def _tick(robot: MujocoRobot) -> Any:
    robot.advance(held(start_posture()), {}, TICK)
    return robot.imu()


def test_it_stands_on_its_soles_with_its_weight() -> None:
    weights: list[float] = []
    for robot in twins(support="ground"):
        assert robot.on_gantry
        run(robot, held(start_posture(True), 3000.0, 40.0), 0.5)
        robot.release()
        run(robot, held(start_posture(True), 3000.0, 40.0), 1.0)
        assert not robot.truth.fallen() and robot.truth.touches() == ()
        weights.append(float(np.mean([_load(robot) for _ in range(25)])))
    assert weights[1] == pytest.approx(weights[0], rel=0.02)


def _load(robot: MujocoRobot) -> float:
    robot.advance(held(start_posture(True), 3000.0, 40.0), {}, TICK)
    return float(robot.truth.foot_forces()[:, 2].sum())


def test_no_air_brakes_its_links() -> None:
    _, robot = twins()
    links = robot._bodies.articulation.get_links()
    assert len(links) > NUM_JOINTS
    assert {(link.get_linear_damping(), link.get_angular_damping()) for link in links} == {(0.0, 0.0)}


def test_a_limp_robot_falls_and_lies_on_more_than_its_feet() -> None:
    _, robot = twins(support="ground")
    robot.release()
    run(robot, held(start_posture(True), 0.0, 1.0), 3.0)
    assert robot.truth.fallen() and robot.truth.touches()


def test_the_hands_open_and_close() -> None:
    for robot in twins():
        hands = {side: HandCommand(0.0, 0.02, 4.0) for side in ("left", "right")}
        run(robot, held(start_posture()), 1.0, hands)
        assert robot.hand("left", 1.0).gap == pytest.approx(0.02, abs=0.002)


def test_the_cameras_see_the_same_room() -> None:
    pictures = [robot.capture("head") for robot in twins(world="furnished", support="ground")]
    depth = [picture[1] for picture in pictures]
    seen = (depth[0] > 0) & (depth[1] > 0)
    assert seen.mean() > 0.3
    assert np.abs(depth[0][seen] - depth[1][seen]).mean() < 0.01


def test_it_walks_into_what_stands_in_the_hall() -> None:
    """A robot that is thrown forwards ends at the ramp, not in it."""
    _, robot = twins(world="slope", support="ground")
    robot.release()
    run(robot, held(start_posture(True), 3000.0, 40.0), RELEASE_TIME)
    robot.push(np.array([400.0, 0.0, 0.0]))
    run(robot, held(start_posture(True), 3000.0, 40.0), 1.5)
    robot.push(np.zeros(3))
    run(robot, held(start_posture(True), 3000.0, 40.0), 1.0)
    assert robot.truth.base().T_world_base[2, 3] > 0.0


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"world": "pack"}, "open, slope, step, rubble"),
        ({"world": "kitchen"}, "no door"),
        ({"self_collision": True}, "option self_collision"),
        ({"cone": "elliptic"}, "option cone"),
        ({"noslip": 3}, "option noslip"),
        ({"slope": 2.0}, "slope is from 0"),
    ],
)
def test_what_physx_cannot_do_is_refused(options: dict[str, Any], why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        PhysxConfig(**options)


def test_people_walk_in_its_hall() -> None:
    _, robot = twins(world="furnished", support="ground", people=2)
    assert len(robot._bodies.kinematic) == 2
    moved = next(iter(robot._bodies.kinematic.values()))
    before = np.array(moved.entity.pose.p)
    run(robot, held(start_posture(True)), 1.0)
    assert np.linalg.norm(np.array(moved.entity.pose.p) - before) > 0.1


def test_the_same_seed_gives_the_same_motion() -> None:
    ends = []
    for _ in range(2):
        _, robot = twins(support="ground")
        run(robot, held(start_posture(True)), 0.5)
        ends.append((robot.joints()[0], robot.imu().acc))
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    np.testing.assert_array_equal(ends[0][1], ends[1][1])
