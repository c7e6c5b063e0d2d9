"""CoM margin, steps and falls: known polygons, known traces, and the real twin put in known poses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from golem.robots.model.table import SOLE
from golem.robots.mujoco.balance import PERIOD, BalanceRecorder, BalanceTrace, convex_hull, signed_margin
from golem.robots.mujoco.engine import MujocoRobot, standing_height
from golem.runtime.lockstep import start_posture

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def trace(n: int = 200) -> BalanceTrace:
    t = PERIOD * np.arange(n, dtype=np.float64)
    zeros = np.zeros((n, 3))
    return BalanceTrace(t, np.full(n, 0.1), zeros, zeros, np.zeros(n), zeros, np.ones((n, 2), bool), zeros)


def test_the_hull_leaves_out_what_is_inside_and_runs_counter_clockwise() -> None:
    rng = np.random.default_rng(0)
    hull = convex_hull(np.concatenate([SQUARE[::-1], rng.uniform(0.1, 0.9, (20, 2)), [[0.5, 0.0]]]))
    x, y = hull.T
    assert len(hull) == 4
    assert 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("point", "margin"),
    [((0.5, 0.5), 0.5), ((0.9, 0.5), 0.1), ((1.2, 0.5), -0.2), ((1.3, 1.4), -0.5), ((0.5, 0.0), 0.0)],
    ids=["middle", "near an edge", "beyond an edge", "beyond a corner", "on the edge"],
)
def test_the_margin_is_the_signed_distance_to_the_edge(point: tuple[float, float], margin: float) -> None:
    assert signed_margin(np.array(point), SQUARE) == pytest.approx(margin)


@pytest.mark.parametrize("corners", [1, 2], ids=["point", "line"])
def test_a_polygon_without_area_encloses_nothing(corners: int) -> None:
    assert signed_margin(np.array([0.5, 0.3]), convex_hull(SQUARE[:corners])) < 0.0


def test_a_step_is_a_foot_off_the_ground_for_longer_than_chatter() -> None:
    still = trace()
    contact = still.contact.copy()
    contact[20:50, 0] = False
    contact[100:130, 1] = False
    contact[150:152, 1] = False
    assert still.steps == 0
    assert replace(still, contact=contact).steps == 2


def test_measures_of_a_known_trace() -> None:
    t = trace().t
    margin = np.where((t >= 0.5) & (t < 0.8), -0.05, 0.1)
    base = np.stack([0.004 * np.sin(2 * np.pi * t), 0.001 * np.cos(2 * np.pi * t), 0.95 + 0 * t], axis=1)
    known = replace(trace(), margin=margin, base=base)
    assert known.below_zero == pytest.approx(0.3)
    assert known.recovery_time(0.4) == pytest.approx(0.3)
    assert known.recovery_time(1.0) == 0.0
    assert known.final_margin == pytest.approx(0.1)
    assert known.base_range == pytest.approx(0.008, rel=0.01)
    assert known.sway == pytest.approx(np.hypot(0.004, 0.001) / np.sqrt(2), rel=0.02)
    assert known.window(0.5, 0.8).final_margin == pytest.approx(-0.05)


def test_a_trace_survives_being_written(tmp_path: Path) -> None:
    path = tmp_path / "artefacts" / "trace.npz"
    written = replace(trace(), margin=np.linspace(-0.2, 0.1, 200))
    written.save(path)
    read = BalanceTrace.load(path)
    assert np.allclose(read.margin, written.margin, atol=1e-6)
    assert read.contact.dtype == bool and read.contact.shape == (200, 2)
    assert path.stat().st_size < 20_000


@pytest.fixture(scope="module")
def robot() -> MujocoRobot:
    return MujocoRobot("ideal", 0, start_posture())


def place(robot: MujocoRobot, height: float, roll: float = 0.0, speed: float = 0.0) -> BalanceRecorder:
    """Put the pelvis at `height` above the floor, heading along y, and look."""
    joint = robot.scene.model.joint("base")
    robot.data.qpos[joint.qposadr[0] : joint.qposadr[0] + 3] = (0.0, 0.0, height)
    heading, tilt = np.zeros(4), np.zeros(4)
    mujoco.mju_axisAngle2Quat(heading, np.array([0.0, 0.0, 1.0]), np.pi / 2)
    mujoco.mju_axisAngle2Quat(tilt, np.array([1.0, 0.0, 0.0]), roll)
    mujoco.mju_mulQuat(robot.data.qpos[joint.qposadr[0] + 3 : joint.qposadr[0] + 7], heading, tilt)
    robot.data.qvel[:] = 0.0
    robot.data.qvel[joint.dofadr[0] + 1] = speed
    mujoco.mj_forward(robot.scene.model, robot.data)
    recorder = BalanceRecorder(robot)
    recorder(0.0)
    return recorder


def test_both_feet_on_the_ground_hold_the_mass_between_them(robot: MujocoRobot) -> None:
    recorder = place(robot, standing_height(start_posture()) - 0.002, speed=0.3)
    seen = recorder.trace()
    assert recorder.contact.tolist() == [True, True]
    assert 0.05 < recorder.margin < 0.5 * (SOLE.x[1] - SOLE.x[0])
    assert seen.rpy[0, 2] == pytest.approx(np.pi / 2)
    assert seen.twist[0] == pytest.approx([0.3, 0.0, 0.0], abs=1e-9)


def test_standing_on_the_edge_of_one_foot_puts_the_mass_outside(robot: MujocoRobot) -> None:
    both = standing_height(start_posture())
    roll = 0.3
    for height in np.arange(both + 0.15, both - 0.15, -0.002):
        recorder = place(robot, float(height), roll)
        if recorder.contact.any():
            break
    assert recorder.contact.tolist() == [False, True]
    assert recorder.margin < -0.02
    assert recorder.trace().rpy[0, 0] == pytest.approx(roll)
    assert not recorder.fallen


def test_lying_down_is_a_fall(robot: MujocoRobot) -> None:
    assert place(robot, 0.95, roll=1.2).fallen


def test_samples_are_a_hundredth_of_a_second_apart(robot: MujocoRobot) -> None:
    recorder = place(robot, 0.95)
    for tick in range(1, 51):
        recorder(0.002 * tick, np.array([0.0, 20.0, 0.0]))
    seen = recorder.trace()
    assert np.diff(seen.t) == pytest.approx(np.full(10, PERIOD))
    assert seen.force[-1].tolist() == [0.0, 20.0, 0.0]


def test_a_recorder_with_a_memory_forgets_the_rest(robot: MujocoRobot) -> None:
    recorder = BalanceRecorder(robot, memory=0.2)
    for i in range(50):
        recorder(PERIOD * i)
    assert recorder.trace().t == pytest.approx(PERIOD * np.arange(30, 50))
    assert recorder.trace(last=0.05).t == pytest.approx(PERIOD * np.arange(45, 50))
