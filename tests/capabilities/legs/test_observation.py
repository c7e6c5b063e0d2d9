from __future__ import annotations

import time
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from golem.capabilities.legs.base import STANDING, LocomotionCommand
from golem.capabilities.legs.observation import TERMS, ObservationLayout, Signals, Term
from golem.errors import ConfigError
from golem.robots.model.spatial import quat_of, rotation_rpy, transform
from golem.robots.model.table import JOINT_INDEX, JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, Array, BaseEstimate, Imu, LowState, Twist

WIDTH = {"q": 27, "dq": 27, "action": 12, "phase": 2}
POSTURE = np.linspace(-1.0, 1.0, NUM_JOINTS)


def signals(shape: tuple[int, ...] = (), seed: int = 0) -> Signals:
    rng = np.random.default_rng(seed)
    values: dict[str, Any] = {f.name: rng.uniform(size=(*shape, WIDTH.get(f.name, 3))) for f in fields(Signals)}
    values["stepping"] = rng.uniform(size=shape) < 0.5
    return Signals(**values)


def everything() -> tuple[Term, ...]:
    """Return the terms that both one robot and many have."""
    return tuple(Term(name) for name in TERMS if name not in ("orientation", "one"))


def test_every_term_is_what_its_name_says() -> None:
    s = signals()
    expected = {
        "base_velocity": s.velocity,
        "base_rate": s.gyro,
        "gravity": s.gravity,
        "twist": s.twist,
        "joint_position": s.q - POSTURE,
        "joint_velocity": s.dq,
        "last_action": s.action,
        "phase_sin": np.sin(2 * np.pi * s.phase) * s.stepping,
        "phase_cos": np.cos(2 * np.pi * s.phase) * s.stepping,
        "joint_angle": s.q,
    }
    left, right = 2 * np.pi * s.phase
    expected["phase"] = np.array([np.sin(left), np.cos(left), np.sin(right), np.cos(right)]) * s.stepping
    assert set(expected) == {term.term for term in everything()}
    for name, values in expected.items():
        np.testing.assert_allclose(ObservationLayout([Term(name)], POSTURE).observe(s), values)


def test_terms_follow_in_their_order_with_scale_and_choice() -> None:
    s = signals()
    terms = [
        Term("joint_velocity", (2.0, 3.0), ("left_knee_joint", "torso_joint")),
        Term("twist", 0.5),
        Term("joint_position", 1.0, ("legs",)),
    ]
    layout = ObservationLayout(terms, POSTURE)
    expected = np.concatenate(
        [
            [2.0 * s.dq[JOINT_INDEX["left_knee_joint"]], 3.0 * s.dq[JOINT_INDEX["torso_joint"]]],
            0.5 * s.twist,
            (s.q - POSTURE)[LEGS],
        ]
    )
    assert layout.size == len(expected)
    np.testing.assert_allclose(layout.observe(s), expected)
    assert layout.components[:3] == (
        ("joint_velocity", "left_knee_joint"),
        ("joint_velocity", "torso_joint"),
        ("twist", "vx"),
    )
    assert layout.components[-1] == ("joint_position", JOINT_NAMES[11])


@pytest.mark.parametrize("shape", [(4,), (3, 2)])
def test_many_robots_are_many_single_ones(shape: tuple[int, ...]) -> None:
    s = signals(shape)
    layout = ObservationLayout(everything(), POSTURE)
    many = layout.observe(s)
    assert many.shape == (*shape, layout.size)
    for index in np.ndindex(*shape):
        one = Signals(**{f.name: getattr(s, f.name)[index] for f in fields(Signals)})
        np.testing.assert_array_equal(many[index], layout.observe(one))


@pytest.mark.parametrize(
    ("terms", "words"),
    [
        ([], ["at least one term", "base_rate"]),
        ([Term("base_rte")], ["observation term 'base_rte'", "Did you mean 'base_rate'?"]),
        ([Term("joint_position", 1.0, ("left_kne_joint",))], ["'left_kne_joint'", "left_knee_joint"]),
        ([Term("twist", 1.0, ("upper",))], ["component of twist 'upper'"]),
        ([Term("gravity", clip=(1.0, -1.0))], ["term gravity's clip"]),
        ([Term("gravity", history=0)], ["term gravity's history", "from 1 to 1000"]),
        ([Term("twist", 1.0, ("legs",))], ["component of twist 'legs'", "vx"]),
        ([Term("twist", (1.0, 2.0))], ["scale of twist", "not a list of 2"]),
        ([Term("twist", float("nan"))], ["scale of twist", "finite"]),
        ([Term("twist", "fast")], ["scale of twist", "'fast'"]),  # type: ignore[arg-type]
    ],
)
def test_a_wrong_layout_is_answered_in_one_sentence(terms: list[Term], words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        ObservationLayout(terms, POSTURE)
    assert all(word in str(caught.value) for word in words), str(caught.value)


def low_state(q: Array, dq: Array, gyro: Array) -> LowState:
    return LowState(0.0, q, dq, np.zeros(NUM_JOINTS), Imu(np.array([1.0, 0, 0, 0]), gyro, np.zeros(3)))


def test_one_robots_signals_are_in_base_link() -> None:
    R = rotation_rpy(0.2, -0.3, 0.7)
    T = transform((1.0, 2.0, 0.9), R)
    velocity, rate, turn = np.array([0.3, -0.2, 0.1]), np.array([0.4, 0.5, 0.6]), 0.8
    q, dq = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)
    q[JOINT_INDEX["torso_joint"]], dq[JOINT_INDEX["torso_joint"]] = turn, 2.0
    # The torso turns with the base and, by its joint, about their common z.
    gyro = rotation_rpy(0, 0, turn).T @ (rate + [0, 0, 2.0])
    motion = LocomotionCommand(Twist(0.1, 0.2, 0.3), np.array([0.25, 0.75]), True, True)
    state, base = low_state(q, dq, gyro), BaseEstimate(0.0, T, R @ velocity)

    def seen(*terms: Term) -> Array:
        return ObservationLayout(terms, POSTURE).look(state, base, motion, np.arange(12.0))

    np.testing.assert_allclose(seen(Term("base_velocity")), velocity)
    np.testing.assert_allclose(seen(Term("base_rate")), rate)
    np.testing.assert_allclose(seen(Term("gravity")), R.T @ [0, 0, -1])
    np.testing.assert_allclose(seen(Term("twist")), [0.1, 0.2, 0.3])
    phases = (Term("phase_sin"), Term("phase_cos", 1.0, ("left",)))
    np.testing.assert_allclose(seen(*phases), [1.0, -1.0, 0.0], atol=1e-15)


def test_one_robot_sees_what_each_of_many_would() -> None:
    rng = np.random.default_rng(2)
    terms = [Term(name, rng.uniform(0.5, 2.0)) for name in rng.permutation([t.term for t in everything()])]
    layout = ObservationLayout(terms, POSTURE)
    for stepping in (False, True):
        R, q, dq, gyro = rotation_rpy(*rng.normal(size=3)), *rng.normal(size=(2, 27)), rng.normal(size=3)
        velocity, twist, phase, action = *rng.normal(size=(2, 3)), rng.uniform(size=2), rng.normal(size=12)
        c, s = np.cos(q[JOINT_INDEX["torso_joint"]]), np.sin(q[JOINT_INDEX["torso_joint"]])
        rate = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ gyro
        rate[2] -= dq[JOINT_INDEX["torso_joint"]]
        many = Signals(q, dq, rate, -R[2], R.T @ velocity, twist, action, phase, np.asarray(float(stepping)))
        motion = LocomotionCommand(Twist(*twist), phase, stepping, True)
        base = BaseEstimate(0.0, transform((1.0, 2.0, 0.9), R), velocity)
        one = layout.look(low_state(q, dq, gyro), base, motion, action)
        np.testing.assert_allclose(one, layout.observe(many), rtol=0.0, atol=1e-12)


def test_what_only_one_robot_sees() -> None:
    zero, R = np.zeros(NUM_JOINTS), rotation_rpy(0.2, -0.3, 0.7)
    base = BaseEstimate(0.0, transform((0, 0, 0.9), R))
    terms = (Term("orientation"), Term("orientation", 1.0, ("x", "w")), Term("one", 0.98))
    terms += (Term("last_action", 1.0, ("torso_joint", "left_knee_joint")), Term("twist", 10.0, ("vx",), (-0.1, 0.1)))
    motion = LocomotionCommand(Twist(0.4), np.zeros(2), False, True)
    seen = ObservationLayout(terms, POSTURE).look(low_state(zero, zero, zero[:3]), base, motion, np.arange(27.0))
    q = quat_of(R)
    np.testing.assert_allclose(seen, [*q, q[1], q[0], 0.98, 12.0, 3.0, 1.0])


@pytest.mark.parametrize(
    ("order", "newest_first", "expected"), [("term", False, [1, 2, 3, 30, 40]), ("term", True, [3, 2, 1, 40, 30])]
)
def test_past_ticks_are_laid_out_as_told(order: str, newest_first: bool, expected: list[float]) -> None:
    terms = (Term("twist", 1.0, ("vx",), history=3), Term("twist", 10.0, ("vy",), history=2))
    assert ticks(ObservationLayout(terms, POSTURE, order, newest_first)) == expected  # type: ignore[arg-type]


@pytest.mark.parametrize(("newest_first", "expected"), [(False, [2, 30, 3, 40]), (True, [3, 40, 2, 30])])
def test_past_ticks_by_frames(newest_first: bool, expected: list[float]) -> None:
    terms = (Term("twist", 1.0, ("vx",), history=2), Term("twist", 10.0, ("vy",), history=2))
    assert ticks(ObservationLayout(terms, POSTURE, "frame", newest_first)) == expected
    with pytest.raises(ConfigError, match="same length"):
        ObservationLayout((*terms, Term("gravity")), POSTURE, "frame")


def ticks(layout: ObservationLayout) -> list[float]:
    """Return what is seen of vx 1, 2, 3 and vy 2, 3, 4 after a reset, at which all past ticks are like the first."""
    zero, base = np.zeros(NUM_JOINTS), BaseEstimate(0.0, np.eye(4))

    def look(vx: float) -> list[float]:
        motion = LocomotionCommand(Twist(vx, vx + 1.0), np.zeros(2), False, True)
        return layout.look(low_state(zero, zero, zero[:3]), base, motion, zero).tolist()

    look(7.0)
    layout.reset()
    assert len(set(look(1.0))) == 2
    look(2.0)
    return look(3.0)


def test_the_clock_shows_zero_while_it_rests() -> None:
    zero = np.zeros(NUM_JOINTS)
    state, base = low_state(zero, zero, np.zeros(3)), BaseEstimate(0.0, np.eye(4))
    layout = ObservationLayout((Term("phase_sin"), Term("phase_cos")), POSTURE)
    np.testing.assert_array_equal(layout.look(state, base, STANDING, np.zeros(12)), 0.0)


def test_one_robot_costs_microseconds() -> None:
    zero = np.zeros(NUM_JOINTS)
    state, base, layout = low_state(zero, zero, np.zeros(3)), BaseEstimate(0.0, np.eye(4)), None
    layout = ObservationLayout(everything(), POSTURE)
    action = np.zeros(12)

    def once() -> Any:
        return layout.look(state, base, STANDING, action)

    best = np.inf
    for _ in range(5):
        begin = time.process_time()
        for _ in range(200):
            once()
        best = min(best, (time.process_time() - begin) / 200)
    assert best < 100e-6  # 16 us on a quiet core; five times that is a mistake, not load
