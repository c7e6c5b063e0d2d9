"""Figures of the leg benches: commands, statistics, odometry, and one real trial."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from golem.capabilities.legs.base import Envelope
from golem.errors import ConfigError
from golem.evaluation import leg_tests
from golem.evaluation.campaign import Done
from golem.evaluation.episodes.odometry import LATENCY, PERIOD, POSITION_NOISE, YAW_NOISE, SimulatedOdometry
from golem.evaluation.leg_bench import LegBenchConfig, LegTrial, run_leg_bench, summarise
from golem.evaluation.subject import Subject, labels
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import start_posture
from golem.types import BaseEstimate

METHODS = Path(__file__).with_name("leg_methods.py")
SUBJECT = Subject(f"{METHODS}:Stiff", "ideal")
ENVELOPE = Envelope((-0.4, 0.8), (-0.3, 0.3), (-0.6, 0.6))


def test_the_first_commands_are_the_ends_edges_and_corners_of_the_envelope() -> None:
    rng = np.random.default_rng(0)
    twists = [leg_tests.command(ENVELOPE, rng, i) for i in range(26)]
    assert len({(t.vx, t.vy, t.wz) for t in twists}) == 26
    assert {t.vx for t in twists} == {-0.4, 0.0, 0.8}
    assert any((t.vx, t.vy, t.wz) == (0.8, -0.3, 0.6) for t in twists)
    drawn = leg_tests.command(ENVELOPE, rng, 26)
    assert ENVELOPE.clamp(drawn) == drawn and drawn not in twists


def test_statistics_count_the_lost_and_leave_out_what_was_not_reached() -> None:
    figures = [
        {"lost": 0.0, "error": -0.02},
        {"lost": 0.0, "error": 0.04},
        {"lost": 1.0, "lost_in_fall": 1.0},
    ]
    done = [Done(LegTrial("stopping", SUBJECT, 0, i), dict(f)) for i, f in enumerate(figures)]
    (row,) = summarise(done)
    assert (row["n"], row["lost"], row["lost_in"]) == (3, 1, {"fall": 1})
    error = row["figures"]["error"]
    assert error["n"] == 2
    assert error["mean"] == pytest.approx(0.01)
    assert error["rms"] == pytest.approx(np.sqrt((0.02**2 + 0.04**2) / 2))
    assert (error["least"], error["most"]) == (-0.02, 0.04)


def test_falls_are_counted_per_robot_hour() -> None:
    figures = [{"lost": 0.0, "seconds": 60.0}] * 59 + [{"lost": 1.0, "lost_in_fall": 1.0, "seconds": 60.0}]
    done = [Done(LegTrial("endurance", SUBJECT, 0, i), dict(f)) for i, f in enumerate(figures)]
    (row,) = summarise(done)
    assert row["robot_hours"] == pytest.approx(1.0)
    assert row["lost_per_hour"] == pytest.approx(1.0)


@pytest.mark.parametrize("source", ["estimator", "truth"])
def test_simulated_odometry_is_its_source_with_noise_at_its_rate(source: Any) -> None:
    bus, robot = Bus(), MujocoRobot("ideal", 0, start_posture())
    believed = np.eye(4)
    believed[:3, 3] = (1.0, 2.0, 0.0)
    odometry = SimulatedOdometry(bus, robot, source, np.random.default_rng(1))
    middle = believed[:2, 3] if source == "estimator" else np.zeros(2)
    errors: list[tuple[float, float, float]] = []
    seen = 0
    for tick in range(30_000):
        t = 0.01 * tick
        bus.deliver(t)
        bus.publish(topics.BASE, BaseEstimate(t, believed), t)
        odometry(t)
        if bus.count(topics.ODOMETRY) > seen:
            seen = bus.count(topics.ODOMETRY)
            found = bus.latest(topics.ODOMETRY)
            assert found is not None and t - found.t >= LATENCY - 1e-9
            x, y = found.T_odom_base[:2, 3] - middle
            errors.append((x, y, np.arctan2(found.T_odom_base[1, 0], found.T_odom_base[0, 0])))
    assert seen == pytest.approx(300.0 / PERIOD, abs=2)
    spread = np.std(errors, axis=0)
    assert spread == pytest.approx([POSITION_NOISE, POSITION_NOISE, YAW_NOISE], rel=0.1)


def test_a_robot_that_stands_still_has_no_range_and_no_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leg_tests, "MINUTE", 1.0)
    figures = LegTrial("quiet", SUBJECT, 0, 0).run()
    assert figures["lost"] == 0.0 and figures["steps"] == 0.0
    assert figures["base_range"] < 0.003
    assert figures["never_negative"] == figures["share_not_negative"] == 1.0


def test_a_broken_controller_is_lost_by_its_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leg_tests, "MINUTE", 1.0)
    figures = LegTrial("quiet", Subject(f"{METHODS}:Broken", "ideal"), 0, 0).run()
    assert figures["lost"] == 1.0 and figures["lost_in_fault"] == 1.0
    assert figures["never_negative"] == 0.0 and "base_range" not in figures, (
        "who is lost does not flatter the mean"
    )


def test_who_does_not_walk_tracks_nothing_rather_than_the_zero_twist() -> None:
    assert LegTrial("tracking", SUBJECT, 0, 0).run() == {"lost": 0.0, "does_not_walk": 1.0}


def test_wrong_options_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="test 'dance'"):
        run_leg_bench(LegBenchConfig(test=("dance",), out=tmp_path / "run"))
    assert list(islice(tmp_path.iterdir(), 1)) == []


def test_few_trials_see_every_end_of_the_envelope() -> None:
    rng = np.random.default_rng(0)
    first = [leg_tests.command(ENVELOPE, rng, i) for i in range(6)]
    assert {(t.vx, t.vy, t.wz) for t in first} == {
        (-0.4, 0.0, 0.0), (0.8, 0.0, 0.0), (0.0, -0.3, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, -0.6), (0.0, 0.0, 0.6)
    }  # fmt: skip


@pytest.mark.parametrize("test", ["endurance", "slope", "rubble", "stopping"])
def test_who_does_not_walk_neither_endures_nor_climbs(test: str) -> None:
    assert LegTrial(test, SUBJECT, 0, 0).run() == {"lost": 0.0, "does_not_walk": 1.0}


def test_who_was_lost_did_not_arrive(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(leg_tests.TESTS, "stopping", lambda *_: leg_tests.lost_in("fall"))
    assert LegTrial("stopping", SUBJECT, 0, 0).run()["arrived"] == 0.0


def test_the_rate_of_the_planner_is_timed_alone(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="alone"):
        run_leg_bench(LegBenchConfig(test=("plans",), j=2, out=tmp_path / "run"))
    with pytest.raises(ConfigError, match="give --method mpc"):
        run_leg_bench(LegBenchConfig(test=("plans",), out=tmp_path / "run"))
    with pytest.raises(ConfigError, match="twice"):
        run_leg_bench(LegBenchConfig(test=("quiet", "quiet"), out=tmp_path / "run"))


def test_labels_are_short_where_that_tells_them_apart() -> None:
    options = "{use: almi, walk: a/x.onnx}"
    assert labels(["a/x.py:L", "almi", options]) == {"a/x.py:L": "x.py:L", "almi": "almi", options: options}
    assert labels(["a/x.py:L", "b/x.py:L"]) == {"a/x.py:L": "a/x.py:L", "b/x.py:L": "b/x.py:L"}
