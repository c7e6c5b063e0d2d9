"""The search for the largest push: levels, counting, the table, and real pushes on either terms."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from golem.errors import ConfigError
from golem.evaluation.base import Case, TrialOutcome, TrialSpec, case_name
from golem.evaluation.rungs.leg_rung import NO_WALKER
from golem.evaluation.rungs.push_limit import PushLimit, PushLimitOptions, allowed
from golem.skills.runner import FAULT

METHODS = Path(__file__).parents[1] / "leg_methods.py"
WON = TrialOutcome(True, "done")


def lost(stage: str = "fall") -> TrialOutcome:
    return TrialOutcome(False, stage)


def search(strengths: dict[str, float], first: float, last: float = 100.0) -> dict[str, list[float]]:
    """Return the levels that are tried, by direction, on a robot that survives up to its strength in each."""
    options = PushLimitOptions(first=first, last=last, direction=tuple(strengths), phase=("standing",))
    rung, found = PushLimit(options), dict[str, list[TrialOutcome]]()
    while True:
        cases = rung.cases(lambda case: found.get(case_name(case)))
        todo = [case for case in cases if case_name(case) not in found]
        if not todo:
            break
        for case in todo:
            survives = float(case["level"]) <= strengths[str(case["direction"])]
            found[case_name(case)] = [WON if survives else lost()] * 2
    return {d: [float(c["level"]) for c in cases if c["direction"] == d] for d in strengths}


@pytest.mark.parametrize(
    ("strength", "first", "tried"),
    [
        (25.0, 10.0, [10, 20, 30]),
        (0.0, 10.0, [10]),
        (25.0, 50.0, [50, 40, 30, 20]),
        (55.0, 50.0, [50, 60]),
        (500.0, 90.0, [90, 100]),
    ],
    ids=["up", "too weak for any", "down", "up from the middle", "the end"],
)
def test_levels_close_in_on_the_limit(strength: float, first: float, tried: list[float]) -> None:
    assert search({"front": strength}, first) == {"front": tried}


def test_every_direction_is_searched_for_itself() -> None:
    assert search({"front": 25.0, "left": 65.0, "back": 500.0}, 40.0, 60.0) == {
        "front": [40, 30, 20],
        "left": [40, 50, 60],
        "back": [40, 50, 60],
    }


def test_one_of_twenty_may_be_lost_and_none_of_ten() -> None:
    assert [allowed(n) for n in (1, 10, 19, 20, 39, 40, 100)] == [0, 0, 0, 1, 1, 2, 5]


def spec(case: Case, method: str = f"{METHODS}:Stiff", index: int = 0) -> TrialSpec:
    return TrialSpec("push-limit", method, "ideal", 0, index, case=case)


def case(direction: str = "front", level: float = 5.0, phase: str = "standing", terms: str = "stack") -> Case:
    walk = "0" if phase == "standing" else "0.3"
    return {"terms": terms, "phase": phase, "walk": walk, "direction": direction, "level": level}


def level(n_lost: int, direction: str, size: float) -> list[tuple[TrialSpec, TrialOutcome]]:
    return [(spec(case(direction, size), index=i), lost() if i < n_lost else WON) for i in range(20)]


def test_the_table_says_what_was_survived_and_what_was_not_found() -> None:
    swing = [(spec(case(d, 10.0, "left_swing")), lost(NO_WALKER)) for d in ("front", "left")]
    trials = [
        *(level(0, "front", 10.0) + level(2, "front", 20.0)),
        *(level(0, "left", 10.0) + level(1, "left", 20.0)),
        *swing,
    ]
    options = PushLimitOptions(direction=("front", "left"), phase=("standing", "left_swing"))
    (table,) = PushLimit(options).tables({"mine": trials})
    assert table.rows == (
        ("mine", "stack", "standing", "10", ">= 20", "10"),
        ("mine", "stack", "left swing at 0.3", "does not walk", "does not walk", "does not walk"),
    )
    assert "that 19 of 20 robots survived" in table.title and "lost with 2 of 20" in table.note
    assert "as few as 76 %" in table.note


def test_every_walk_has_rows_of_its_own_and_standing_has_one() -> None:
    rung = PushLimit(PushLimitOptions(phase=("standing", "walking"), walk=("0.3", "0.6,0,0.4")))
    assert {(c["phase"], c["walk"]) for c in rung.cases(lambda case: None)} == {
        ("standing", "0"), ("walking", "0.3"), ("walking", "0.6,0,0.4")
    }  # fmt: skip


def test_the_gates_share_is_split_into_stops_and_clipping() -> None:
    limits = {"stack": 40.0, "unstopped": 50.0, "ungated": 80.0, "own": 90.0}
    trials = [
        (spec(case("front", size, terms=terms), index=i), WON if size <= limit else lost())
        for terms, limit in limits.items()
        for size in (limit, limit + 10.0)
        for i in range(2)
    ]
    options = PushLimitOptions(terms=tuple(limits), direction=("front",), phase=("standing",))  # pyright: ignore[reportArgumentType]
    found, cost = PushLimit(options).tables({"mine": trials})
    assert [row[1:4] for row in found.rows] == [(t, "standing", f"{v:g}") for t, v in limits.items()]
    assert cost.rows == (("mine", "standing", "10", "30", "40", "10"),)


def test_the_plot_has_a_line_of_circles_for_every_gait() -> None:
    figure = pytest.importorskip("matplotlib.figure", reason="the extra report is not installed").Figure()
    options = PushLimitOptions(terms=("stack", "own"), phase=("standing", "walking"), walk=("0.3", "0.6"))
    assert PushLimit(options).plot({"mine": level(0, "front", 10.0)}, figure)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == [
        f"{gait}, {t}" for gait in ("standing", "walking at 0.3", "walking at 0.6") for t in ("stack", "own")
    ]
    assert {axes.get_gridspec().get_geometry() for axes in figure.axes} == {(3, 2)}


def test_a_gate_that_may_not_stop_lets_a_robot_fall() -> None:
    (found,) = run([case("front", 120.0, terms="unstopped")])
    assert found.stage == "fall" and found.series["peak_tilt"] > 0.5


def run(cases: Sequence[Case], method: str = "Stiff", **options: Any) -> list[TrialOutcome]:
    rung = PushLimit(PushLimitOptions(**options))
    specs = [spec(c, f"{METHODS}:{method}" if method[0].isupper() else method) for c in cases]
    assert len({rung.together(s) for s in specs}) == 1
    return list(rung.run_together(specs))


@pytest.mark.parametrize("terms", ["stack", "own"])
def test_real_pushes_are_survived_and_lost_and_share_their_past(terms: str) -> None:
    both = [case("front", terms=terms), case("back", terms=terms), case("front", 120.0, terms=terms)]
    found = run(both)
    assert [outcome.success for outcome in found] == [True, True, False]
    assert found == [run([one])[0] for one in both], "alone as together"
    tilts = [outcome.series["peak_tilt"] for outcome in found]
    if terms == "own":
        assert found[2].stage == "fall" and tilts[2] > 0.5
    else:  # its gate sees that the balance is lost before the robot leans
        assert found[2].stage == "safety" and "balance_lost" in found[2].detail and 0.5 > tilts[2] > 0.1
        assert found[2].module == f"lower_body: {METHODS}:Stiff"
    assert 0.1 > tilts[0] > 0.0


@pytest.mark.parametrize("terms", ["stack", "own"])
def test_who_only_stands_is_not_asked_to_walk_again(terms: str) -> None:
    (found,) = run([case(phase="left_swing", terms=terms)])
    assert found.stage == NO_WALKER
    rung = PushLimit(PushLimitOptions(first=40.0))
    assert rung.next([NO_WALKER], 40.0) is None


def test_who_falls_or_breaks_its_contract_before_the_push_is_named_on_its_own_terms() -> None:
    (limp,) = run([case(terms="own")], "Limp")
    assert (limp.stage, limp.series) == ("fall", {})
    # It raises after 2 s, and stands for 2 to 3 s before the shove.
    (broken,) = run([case(terms="own")], "Broken")
    assert broken.stage == FAULT and "my bug" in broken.detail


def test_ours_walks_as_told_and_takes_a_shove_in_mid_step_on_its_own_terms() -> None:
    (found,) = run([case("right", 20.0, "left_swing", "own")], "almi")
    assert found.success and found.series["steps"] >= 6
    assert found.series["speed_before"] == pytest.approx(0.3, abs=0.1)


@pytest.mark.slow
def test_ours_is_caught_where_the_walking_network_alone_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    shoves = [case(direction, 80.0, "walking", "own") for direction in ("left", "front_right")]
    assert all(outcome.success for outcome in run(shoves, "almi"))
    monkeypatch.setattr("golem.capabilities.legs.almi.SHOVED", None)
    assert not any(outcome.success for outcome in run(shoves, "almi"))


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"step": 0.0}, "--step"),
        ({"first": 50.0, "last": 20.0}, "--last"),
        ({"direction": ("left", "left")}, "--direction"),
        ({"direction": ("north",)}, "direction 'north'"),
        ({"phase": ()}, "--phase"),
        ({"walk": ("0.3", "0")}, "--walk '0'.*--phase standing"),
        ({"walk": ("0.3,0.1",)}, "--walk '0.3,0.1'"),
        ({"walk": ("fast",)}, "--walk 'fast'"),
    ],
)
def test_options_that_cannot_be_meant_are_refused(change: dict[str, Any], word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        PushLimit(PushLimitOptions(**change))


def test_the_vendors_legs_have_no_terms_of_their_own() -> None:
    with pytest.raises(ConfigError, match="vendor runs on the robot's own computer"):
        PushLimit(PushLimitOptions(terms=("own",))).config("vendor", "ideal", {})
