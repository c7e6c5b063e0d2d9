"""The tour: what is drawn for it, who steers, who is blamed, and that it repeats, cut short."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from golem.capabilities.arms.postures import POSTURES, mirror
from golem.errors import ConfigError
from golem.evaluation.base import RUNGS, Outcomes, TrialOutcome, TrialSpec, make_rung
from golem.evaluation.episodes.episode import Episode, Loss
from golem.evaluation.rungs import tour
from golem.evaluation.rungs import tour as league
from golem.types import PlanarPose, Twist

METHODS = Path(__file__).parents[1] / "leg_methods.py"


def run(method: str, waypoints: int, monkeypatch: pytest.MonkeyPatch, engine: str = "mujoco") -> TrialOutcome:
    monkeypatch.setattr(tour, "WAYPOINTS", waypoints)
    rung = make_rung(RUNGS["tour"], {"engine": [engine]})
    return rung.run(TrialSpec("tour", method, "bench", 0, 0, case={"engine": engine}), None)


def test_waypoints_fill_their_disc() -> None:
    drawn = league.draw_waypoints(np.random.default_rng(0), 4000)
    radii = np.hypot([p.x - 0.3 for p in drawn], [p.y for p in drawn])
    assert radii.max() <= 0.75 and np.median(radii) == pytest.approx(0.75 * math.sqrt(0.5), abs=0.02)
    assert np.std([p.yaw for p in drawn]) == pytest.approx(math.pi / math.sqrt(3.0), rel=0.03)


def test_punches_grow_for_a_minute_and_with_the_mass() -> None:
    rng = np.random.default_rng(0)
    forces = np.array([[np.linalg.norm(f) for _, f in league.draw_punches(rng, 18, 35.1)] for _ in range(300)])
    ceiling = 500.0 * np.minimum(1.0 / 3.0 + 2.0 / 3.0 * np.arange(18) / 12.0, 1.0)
    assert np.all(forces <= ceiling + 1e-9) and np.all(forces >= ceiling / 2 - 1e-9)
    assert np.allclose(forces.mean(axis=0), 0.75 * ceiling, rtol=0.05)
    light, heavy = (league.draw_punches(np.random.default_rng(1), 18, mass) for mass in (35.1, 70.2))
    assert all(a == b and np.allclose(2 * f, g) for (a, f), (b, g) in zip(light, heavy, strict=True))
    assert len({link for link, _ in league.draw_punches(rng, 1000, 35.1)}) == 27


def test_the_arms_never_rest_for_long_and_mirror_each_other() -> None:
    times, places = league.draw_arms(np.random.default_rng(0), 90.0)
    assert times[0] == 0.5 and times[-1] == 90.0 and places.shape == (180, 15)
    assert np.allclose([mirror(place) for place in places], places)
    assert np.abs(places - POSTURES["home"]).max() <= 0.5 + 1e-9
    assert (np.abs(np.diff(places, axis=0)).max(axis=1) > 0.0).mean() > 0.95


def test_the_operator_steers_lets_go_and_steers_again() -> None:
    operator = league.Operator(PlanarPose(1.0, 0.0, 0.0))
    asked = operator.steer(PlanarPose(1.0, -0.4, math.pi / 2))
    assert (asked.vx, asked.vy, asked.wz) == pytest.approx((0.6, 0.0, -1.5 * math.pi / 2))
    assert operator.steer(PlanarPose(0.95, 0.0, 0.01)) == Twist(0.0, 0.0, 0.0)
    assert operator.steer(PlanarPose(0.85, 0.0, 0.1)) == Twist(0.0, 0.0, 0.0)
    assert operator.steer(PlanarPose(0.75, 0.0, 0.0)).vx == pytest.approx(0.375)


def test_who_only_stands_is_told_so_with_what_it_survived(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tour, "SEGMENT", 0.08)
    outcome = run(f"{METHODS}:Stiff", 1, monkeypatch)
    assert outcome.series["seconds"] == pytest.approx(0.08) and outcome.series["lived"] == 1.0
    assert (outcome.success, outcome.stage, outcome.module) == (False, "walk", f"lower_body: {METHODS}:Stiff")


def test_a_broken_controller_is_blamed_and_an_arm_that_was_thrown_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    outcome = run(f"{METHODS}:Broken", 1, monkeypatch)
    assert (outcome.stage, outcome.module) == ("fault", f"lower_body: {METHODS}:Broken")
    for joint, module in (("left_elbow_joint", None), ("left_knee_joint", f"lower_body: {METHODS}:Stiff")):
        monkeypatch.setattr(
            Episode, "loss", Loss("safety", f"Safety stop at 3.0 s: joint_velocity: {joint} at 9 rad/s.")
        )
        assert run(f"{METHODS}:Stiff", 1, monkeypatch).module == module


def test_what_cannot_be_is_refused() -> None:
    for options, text in (({"engine": []}, "--engine names nothing"), ({"lift": "brakes"}, "Unknown limit 'brakes'")):
        with pytest.raises(ConfigError, match=text):
            make_rung(RUNGS["tour"], options)
    rung = make_rung(RUNGS["tour"], {"engine": ["mujocoo"]})
    with pytest.raises(ConfigError, match="Did you mean 'mujoco'"):
        rung.config("almi", "bench", {})
    with pytest.raises(ConfigError, match="--engine; leave out --use robot"):
        rung.config("almi", "bench", {"robot": "physx"})


def outcomes(**engines: list[float]) -> Outcomes:
    def one(engine: str, i: int, seconds: float) -> tuple[TrialSpec, TrialOutcome]:
        won = seconds == 90.0
        spec = TrialSpec("tour", "almi", "bench", 0, i, case={"engine": engine})
        return spec, TrialOutcome(won, "done" if won else "fall", series={"seconds": seconds})

    return {"almi": [one(e, i, s) for e, times in engines.items() for i, s in enumerate(times)]}


def test_engines_are_paired_tour_by_tour() -> None:
    rung: Any = make_rung(RUNGS["tour"])
    assert rung.tables(outcomes(mujoco=[90.0, 10.0])) == ()
    (table,) = rung.tables(outcomes(mujoco=[90.0, 90.0, 30.0, 90.0], physx=[90.0, 60.0, 40.0, 90.0]))
    assert table.rows[0][:3] == ("almi", "mujoco - physx", "4")
    assert table.rows[0][3].startswith("+25 [") and table.rows[0][5].startswith("+5 [")


def test_the_curve_falls_where_robots_were_lost() -> None:
    figures = pytest.importorskip("matplotlib.figure")
    figure = figures.Figure(layout="constrained")
    rung: Any = make_rung(RUNGS["tour"])
    assert rung.plot(outcomes(mujoco=[90.0, 30.0, 60.0, 90.0]), figure)
    (line,) = figure.axes[0].lines
    assert line.get_xdata().tolist() == [0.0, 30.0, 60.0, 90.0] and line.get_ydata().tolist() == [100, 75, 50, 50]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", pytest.param("physx", marks=pytest.mark.long)])
def test_a_short_tour_repeats_bit_for_bit(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if engine == "physx":
        pytest.importorskip("sapien")
    one, other = (run("almi", 2, monkeypatch, engine) for _ in range(2))
    assert one.series == other.series and one.success == other.success
    assert one.success and one.series["seconds"] == pytest.approx(10.0, abs=0.05)
    assert one.series["distance"] > 0.5 and one.series["work"] > 100.0 and one.series["reached"] >= 0.5
