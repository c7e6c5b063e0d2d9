from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from golem.capabilities.arms.base import TargetError, UpperBody
from golem.capabilities.arms.diff_ik import DiffIK
from golem.capabilities.arms.line import Line
from golem.capabilities.arms.postures import downward, posture
from golem.capabilities.arms.task_space import TaskSpaceConfig
from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.sphere_robot import load_spheres
from golem.errors import ConfigError
from golem.hardware.safety.base import SafetyLimits
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.types import NUM_JOINTS, SIDES, UPPER, Array

DT = 0.01


def whole(q: Array) -> Array:
    out = np.zeros(NUM_JOINTS)
    out[UPPER] = q
    return out


@pytest.fixture
def ik() -> DiffIK:
    ik = DiffIK()
    ik.reset(whole(posture("ready")))
    return ik


def hands(ik: DiffIK) -> tuple[Array, Array]:
    return ik.kinematics.pose("left", ik.q), ik.kinematics.pose("right", ik.q)


def test_is_an_upper_body(ik: DiffIK) -> None:
    assert isinstance(ik, UpperBody)


@pytest.mark.slow
def test_two_circles_are_tracked(ik: DiffIK) -> None:
    left, right = hands(ik)
    errors = []
    for k in range(400):
        phase = 2 * np.pi * k * DT / 4.0
        shift = 0.08 * np.array([0.0, np.sin(phase), np.cos(phase) - 1.0])
        goals = left.copy(), right.copy()
        goals[0][:3, 3] += shift
        goals[1][:3, 3] += shift
        command = ik.step(*goals, whole(ik.q), DT)
        errors.append(command.error_position)
        assert command.error_rotation.max() < 1e-3
        assert not command.limited
    assert np.mean(errors) < 1e-5
    assert np.max(errors) < 5e-5


def test_reported_errors_are_those_of_the_commanded_joints(ik: DiffIK) -> None:
    goal = downward(0.5, -0.1, 0.15, -1.0)
    command = ik.step(None, goal, whole(ik.q), DT)
    reached = ik.kinematics.pose("right", command.q)
    assert command.error_position[1] == pytest.approx(np.linalg.norm(goal[:3, 3] - reached[:3, 3]), abs=1e-12)
    angle = np.arccos(np.clip((np.trace(reached[:3, :3].T @ goal[:3, :3]) - 1) / 2, -1, 1))
    assert command.error_rotation[1] == pytest.approx(angle, abs=1e-6)
    assert command.error_position[0] == command.error_rotation[0] == 0.0


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_work_area_is_reached_at_servo_speed(side: str, ik: DiffIK) -> None:
    sign = 1.0 if side == "left" else -1.0
    start = hands(ik)[0 if side == "left" else 1]
    row = 0 if side == "left" else 1
    for x, y in [(0.40, 0.02), (0.432, 0.0), (0.432, 0.36), (0.50, 0.12), (0.52, 0.3)]:
        ik.reset(whole(posture("ready")))
        above, at = (downward(x, sign * y, z, sign * np.pi / 2) for z in (0.21, 0.06))
        for line in (Line(start, above, v_max=0.25), Line(above, at, v_max=0.1), Line(at, above, v_max=0.1)):
            for k in range(int(line.duration / DT) + 2):
                goal = line.pose(k * DT)
                pair = (goal, None) if side == "left" else (None, goal)
                command = ik.step(*pair, whole(ik.q), DT)
                assert command.error_position[row] < 6e-4
                assert command.error_rotation[row] < 5e-3
        assert abs(command.q[0]) < 0.25


def test_an_arm_without_target_keeps_its_posture(ik: DiffIK) -> None:
    goal = downward(0.5, 0.0, 0.2, -np.pi / 2)
    before = ik.q.copy()
    for _ in range(50):
        command = ik.step(None, goal, whole(ik.q), DT)
    np.testing.assert_array_equal(command.q[1:8], before[1:8])
    assert np.abs(command.q[8:] - before[8:]).max() > 0.05
    held = ik.step(None, None, whole(ik.q), DT)
    np.testing.assert_array_equal(held.q, command.q)
    assert not held.limited


def test_measured_joints_do_not_feed_back(ik: DiffIK) -> None:
    goal = downward(0.45, -0.2, 0.15, -np.pi / 2)
    sagging = whole(ik.q - 0.1)
    other = DiffIK()
    other.reset(whole(posture("ready")))
    for _ in range(20):
        a = ik.step(None, goal, sagging, DT)
        b = other.step(None, goal, whole(other.q), DT)
        np.testing.assert_array_equal(a.q, b.q)


coordinate = st.floats(-2.0, 2.0)
quaternions = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda v: np.linalg.norm(v) > 0.1)


@st.composite
def poses(draw: st.DrawFn) -> Array:
    w, x, y, z = np.array(q := draw(quaternions)) / np.linalg.norm(q)
    T = np.eye(4)
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    T[:3, 3] = [draw(coordinate) for _ in range(3)]
    return T


SHARED = DiffIK()


@settings(max_examples=60)
@given(
    left=st.none() | poses(),
    right=st.none() | poses(),
    start=st.lists(st.floats(-4, 4), min_size=NUM_JOINTS, max_size=NUM_JOINTS),
    dt=st.floats(1e-4, 0.1),
)
def test_limits_hold_for_any_target(left: Array | None, right: Array | None, start: list[float], dt: float) -> None:
    ik = SHARED
    ik.reset(np.array(start))
    before = ik.q.copy()
    # A joint may begin outside the range it works in, up to its stop, and then it does not go further.
    lower, upper = np.minimum(ik.lower, before), np.maximum(ik.upper, before)
    stops = ik.kinematics.stops
    assert (before >= stops[0]).all() and (before <= stops[1]).all()
    for _ in range(15):
        command = ik.step(left, right, np.array(start), dt)
        assert np.isfinite(command.q).all()
        assert (command.q >= lower).all() and (command.q <= upper).all()
        assert (np.abs(command.q - before) <= ik.speed * dt + 1e-12).all()
        before = command.q


def test_a_waist_that_was_turned_far_stays_until_a_hand_is_sent_and_then_comes_back_slowly(ik: DiffIK) -> None:
    q = whole(posture("ready"))
    q[12] = 1.2
    ik.reset(q)
    assert ik.step(None, None, q, DT).q[0] == 1.2
    goal = downward(0.43, -0.22, 0.15, -np.pi / 2)
    at_waist: list[float] = []
    for k in range(600):
        command = ik.step(None, goal, q, DT)
        at_waist.append(command.q[0])
        # The hand does not wait for the waist.
        assert k < 200 or command.error_position[1] < 0.08
    waist = np.array(at_waist)
    steps = np.diff(np.append(1.2, waist))
    assert np.abs(steps).max() <= ik.speed[0] * DT + 1e-12
    assert waist[-1] <= ik.upper[0] < waist[200]


@pytest.mark.parametrize("z", [-0.6, 1.6])
def test_an_unreachable_target_is_approached_and_then_waited_at(z: float, ik: DiffIK) -> None:
    goal = downward(0.43, -0.22, z, -np.pi / 2)
    first = ik.step(None, goal, whole(ik.q), DT)
    assert first.limited
    for _ in range(700):
        command = ik.step(None, goal, whole(ik.q), DT)
    assert command.error_position[1] < first.error_position[1]
    still = [ik.step(None, goal, whole(ik.q), DT).q for _ in range(50)]
    speed = np.diff(still, axis=0) / DT
    assert np.abs(speed).max() < 0.2
    assert np.abs(np.diff(speed, axis=0)).max() < 0.02  # it may drift along a limit, it must not chatter


def test_same_input_same_output_bit_for_bit() -> None:
    runs = []
    for _ in range(2):
        ik = DiffIK()
        ik.reset(whole(posture("home")))
        goal = downward(0.45, -0.1, 0.1, -1.3)
        runs.append([ik.step(None, goal, whole(ik.q), DT).q for _ in range(100)])
    np.testing.assert_array_equal(runs[0], runs[1])


def nan_pose() -> Array:
    T = np.eye(4)
    T[0, 3] = np.nan
    return T


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((nan_pose(), None, np.zeros(27), DT), "left hand contains NaN"),
        ((None, np.eye(3), np.zeros(27), DT), "4x4"),
        ((None, np.diag([1.0, 1.0, -1.0, 1.0]), np.zeros(27), DT), "rigid"),
        ((None, 2 * np.eye(4), np.zeros(27), DT), "rigid"),
        ((None, None, np.full(27, np.inf), DT), "q_measured contains NaN"),
        ((None, None, np.zeros(15), DT), "27"),
        ((None, None, np.zeros(27), 0.0), "dt"),
        ((None, None, np.zeros(27), float("nan")), "dt"),
    ],
)
def test_nonsense_is_refused_and_changes_nothing(ik: DiffIK, arguments: Any, words: str) -> None:
    before = ik.q.copy()
    with pytest.raises(TargetError, match=words):
        ik.step(*arguments)
    np.testing.assert_array_equal(ik.q, before)


def test_reset_refuses_nan(ik: DiffIK) -> None:
    with pytest.raises(TargetError, match="start from"):
        ik.reset(np.full(27, np.nan))


def test_an_unsolved_program_holds_still(ik: DiffIK, monkeypatch: pytest.MonkeyPatch) -> None:
    import daqp

    monkeypatch.setattr(daqp, "solve", lambda *a, **k: (np.full(15, np.nan), 0.0, -1, {}))
    before = ik.q.copy()
    command = ik.step(None, downward(0.5, -0.2, 0.2, -1.5), whole(ik.q), DT)
    np.testing.assert_array_equal(command.q, before)
    assert command.limited


@pytest.mark.parametrize(
    "options", [{"palm_gain": 0.0}, {"arm_speed": -1.0}, {"damping": 0.0}, {"limit_margin": -0.1}, {"posture": "redy"}]
)
def test_options_out_of_range_are_named(options: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=next(iter(options))):
        DiffIK(TaskSpaceConfig(**options))


def test_nothing_is_planned_where_the_gate_does_not_let_the_arm_go(ik: DiffIK) -> None:
    gate = SafetyLimits.from_profile()
    lower, upper = gate.lower[UPPER], gate.upper[UPPER]
    rng = np.random.default_rng(0)
    for _ in range(30):
        goal = downward(rng.uniform(0.1, 0.9), rng.uniform(-0.8, 0.8), rng.uniform(-0.4, 0.6), 0.0)
        for _ in range(30):
            q = ik.step(goal, None, whole(ik.q), DT).q
            assert (q >= lower).all() and (q <= upper).all()


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("count", [10_000, pytest.param(100_000, marks=pytest.mark.long)])
def test_targets_reachable_or_not_leave_the_gate_nothing_to_clip(ik: DiffIK, count: int) -> None:
    gate = SafetyLimits.from_profile()
    lower, upper = gate.lower[UPPER], gate.upper[UPPER]
    rng, before = np.random.default_rng(0), ik.q.copy()
    turns = rng.standard_normal((count, 4))
    places = rng.uniform((-0.8, -1.2, -1.0), (1.2, 1.2, 1.2), (count, 3))
    goal: dict[str, Array] = {}
    for k, (turn, place) in enumerate(zip(turns, places, strict=True)):
        # Every tick one hand gets a new target anywhere, turned anyhow; the other goes on to its own.
        goal[SIDES[k % 2]] = pin.XYZQUATToSE3(np.append(place, turn / np.linalg.norm(turn))).homogeneous
        q = ik.step(goal.get("left"), goal.get("right"), whole(before), DT).q
        assert np.isfinite(q).all()
        assert (q >= lower).all() and (q <= upper).all()
        assert (np.abs(q - before) <= ik.speed * DT + 1e-12).all()
        before = q


def test_an_arm_beyond_the_gates_range_stays_until_it_has_a_target(ik: DiffIK) -> None:
    start = posture("ready")
    start[4] = load_limits().upper[UPPER][4]  # the left elbow at its stop
    ik.reset(whole(start))
    goal = ik.kinematics.pose("right", start)
    assert ik.step(None, goal, whole(start), DT).q[4] == start[4]
    after = ik.step(ik.kinematics.pose("left", start), goal, whole(start), DT).q
    assert start[4] - after[4] == pytest.approx(ik.config.arm_speed * DT)


def test_links_are_kept_apart_on_request() -> None:
    # The right hand is sent to the left forearm.
    nearest = {}
    for rows in (0, 6):
        ik = DiffIK(TaskSpaceConfig(collision_rows=rows, clearance=0.01))
        ik.reset(whole(posture("ready")))
        spheres = CollisionModel(load_spheres(), JOINT_NAMES[UPPER])
        goal = ik.kinematics.pose("right", ik.q)
        goal[:3, 3] = ik.kinematics.pose("left", ik.q)[:3, 3] - 0.02
        distances = []
        for _ in range(150):
            command = ik.step(None, goal, whole(ik.q), DT)
            distances.append((*spheres.nearest(command.q, 1, 0.2).distance, 0.2)[0])
        nearest[rows] = min(distances)
        if rows:
            assert ik.task.distance[0] == pytest.approx(distances[-1])
            assert command.error_position[1] > 0.02
    assert nearest[0] < -0.005 and nearest[6] > 0.0


def test_steps_are_damped_at_a_singularity() -> None:
    straight = np.zeros(15)
    straight[[1, 8]], straight[[4, 11]] = -1.2, 1.45  # the elbow is straight near 1.5

    def largest(damping: float) -> float:
        ik = DiffIK(TaskSpaceConfig(singular_damping=damping, singular_value=0.05, palm_speed=10.0))
        ik.reset(whole(straight))
        assert ik.kinematics.manipulability("left", ik.q) < 0.05
        goal = ik.kinematics.pose("left", ik.q)
        goal[:3, 3] += goal[:3, 2] * 0.003
        return float(np.abs(ik.step(goal, None, whole(straight), 1.0).q - straight).max())

    assert largest(1e-3) < 0.5 * largest(0.0)


@pytest.mark.parametrize(("x", "y"), [(0.30, 0.10), (0.36, 0.04), (0.42, 0.10), (0.45, -0.12)])
def test_a_target_that_counts_as_reached_is_reached_through_the_gate(x: float, y: float, ik: DiffIK) -> None:
    gate = SafetyLimits.from_profile()
    goal = downward(x, y, -0.035, -np.pi / 2)
    for z in (0.2, -0.035):
        for _ in range(120):
            command = ik.step(None, downward(x, y, z, -np.pi / 2), whole(ik.q), DT)
    passed = np.clip(command.q, gate.lower[UPPER], gate.upper[UPPER])
    off = np.linalg.norm(ik.kinematics.pose("right", passed)[:3, 3] - goal[:3, 3])
    assert off == pytest.approx(command.error_position[1], abs=1e-9)
