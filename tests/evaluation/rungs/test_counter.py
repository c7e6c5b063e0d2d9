"""The errands of the counter rungs: drawn from the trial, always possible to ask for, judged by the truth."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.base import Case, TrialSpec
from golem.evaluation.episodes.episode import episode_seed
from golem.evaluation.rungs.counter import CounterOptions, CounterTether, FetchRung, draw_errand, draw_fetch
from golem.registry import configure
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.scene import lay_kitchen
from golem.robots.worlds.kitchen import draw_counter, mirrored
from golem.robots.worlds.tableware import KINDS
from golem.runtime.lockstep import build_robot


@pytest.mark.parametrize("index", range(8))
def test_an_errand_leads_elsewhere_and_to_a_free_place(index: int) -> None:
    kitchen = draw_counter(np.random.default_rng(index))
    assert {thing.kind for thing in kitchen.things} == set(KINDS)
    errand = draw_errand(TrialSpec("counter-tether", "centroid", "field", 1, index), kitchen)
    assert errand == draw_errand(TrialSpec("counter-stand", "antipodal", "ideal", 1, index), kitchen)
    assert errand is not None
    kind, hand, place = errand
    (thing,) = (one for one in kitchen.things if one.kind == kind)
    assert (thing.position[1] > 0.0) == (hand == "left")
    assert np.hypot(*np.subtract(place, thing.position[:2])) > 0.1
    for other in kitchen.things:
        if other is not thing:
            room = np.hypot(*np.subtract(other.position[:2], place)) - KINDS[kind][0] - KINDS[other.kind][0]
            assert room > 0.03


def test_only_places_with_room_are_asked_for() -> None:
    back = 0
    for index, (kind, hand) in enumerate([(kind, hand) for kind in KINDS for hand in ("left", "right")] * 12):
        kitchen = draw_counter(np.random.default_rng(index))
        case: Case = {"thing": kind, "hand": hand}
        _, _, place = draw_errand(TrialSpec("counter-tether", "centroid", "field", 1, index, case=case), kitchen)
        (thing,) = (one for one in kitchen.things if one.kind == kind)
        back += place == pytest.approx(tuple(thing.position[:2]))
        assert place[0] - KINDS[kind][0] > kitchen.counter_front or place == pytest.approx(tuple(thing.position[:2]))
        for other in kitchen.things:
            if other is not thing:
                room = np.hypot(*np.subtract(other.position[:2], place)) - KINDS[kind][0] - KINDS[other.kind][0]
                assert room > 0.01
    assert 0 < back < 20


def test_a_place_is_free_after_the_thing_was_moved_too() -> None:
    for index in range(24):
        kitchen = draw_counter(np.random.default_rng(index))
        spec = TrialSpec("fetch", "object_map", "field", 1, index, case={"moved": "yes"})
        kind, place, after = draw_fetch(spec, kitchen)
        moved = [b for a, b in zip(kitchen.things, after.things, strict=True) if a != b]
        assert len(moved) == 2 and kind in [thing.kind for thing in moved]
        (thing,) = (one for one in after.things if one.kind == kind)
        for other in after.things:
            if other is not thing:
                room = np.hypot(*np.subtract(other.position[:2], place)) - KINDS[kind][0] - KINDS[other.kind][0]
                assert room > 0.01


def test_the_things_that_are_asked_for_are_tried_case_by_case() -> None:
    rung = CounterTether(CounterOptions(thing=("can", "bowl")))
    cases = rung.cases(lambda case: None)
    assert cases == [{"thing": "can"}, {"thing": "bowl"}]
    kitchen = draw_counter(np.random.default_rng(0))
    for case in cases:
        kind, hand, _ = draw_errand(TrialSpec("counter-tether", "centroid", "field", 1, 0, case=case), kitchen)
        (thing,) = (one for one in kitchen.things if one.kind == case["thing"])
        assert kind == case["thing"] and (thing.position[1] > 0.0) == (hand == "left")
    both = CounterTether(CounterOptions(thing=("can",), each=True)).cases(lambda case: None)
    assert both == [{"thing": "can", "hand": "left"}, {"thing": "can", "hand": "right"}]
    with pytest.raises(ConfigError, match="Unknown thing 'spoon'; valid: "):
        CounterTether(CounterOptions(thing=("spoon",))).cases(lambda case: None)


def test_every_thing_is_tried_with_either_hand() -> None:
    rung = CounterTether(CounterOptions(each=True))
    cases = rung.cases(lambda case: None)
    assert len(cases) == 2 * len(KINDS)
    kitchen = draw_counter(np.random.default_rng(0))
    for case in cases:
        errand = draw_errand(TrialSpec("counter-tether", "centroid", "field", 1, 0, case=case), kitchen)
        assert errand is not None and errand[:2] == (case["thing"], case["hand"])


def test_a_counter_is_mirrored_where_a_hand_would_have_to_reach_across() -> None:
    rung = CounterTether(CounterOptions(each=True))
    kitchen = draw_counter(np.random.default_rng(0))
    spec = TrialSpec("counter-tether", "centroid", "field", 1, 0)
    assert not rung.mirrored(spec, kitchen)
    for case in rung.cases(lambda case: None):
        own = TrialSpec("counter-tether", "centroid", "field", 1, 0, case=case)
        there = mirrored(kitchen) if rung.mirrored(own, kitchen) else kitchen
        (thing,) = (one for one in there.things if one.kind == case["thing"])
        assert (1.0 if case["hand"] == "left" else -1.0) * thing.position[1] > -0.07


def test_the_counter_of_a_case_is_mirrored_before_the_robot_is_built() -> None:
    rung = CounterTether(CounterOptions(each=True, sizes=0.2))
    stack = rung.make_stack("antipodal", "ideal", {})
    turned: list[bool] = []
    for case in rung.cases(lambda case: None):
        spec = TrialSpec("counter-tether", "antipodal", "ideal", 5, 1, case=case)
        options = rung.arranged(spec, stack).choice("robot").options
        kitchen = lay_kitchen(configure("robot", "mujoco", options), episode_seed(5, 1))
        assert not rung.mirrored(spec, kitchen)
        turned.append(bool(options.get("mirrored")))
    assert any(turned) and not all(turned)
    with closing(build_robot(rung.arranged(spec, stack), episode_seed(5, 1))) as robot:
        places = [(one.kind, one.position[:2]) for one in robot.scene.kitchen.things]
    assert places == [(one.kind, one.position[:2]) for one in kitchen.things]


def test_things_have_the_sizes_that_are_asked_for() -> None:
    plain, grown = (draw_counter(np.random.default_rng(3), sizes=share) for share in (0.0, 0.2))
    assert [one.position for one in plain.things] == [one.position for one in grown.things]
    sizes = [one.size for one in grown.things]
    assert len(set(sizes)) == 4 and all(0.8 <= size <= 1.2 for size in sizes)
    stack = CounterTether(CounterOptions(sizes=0.2)).make_stack("antipodal", "ideal", {})
    assert stack.choice("robot").options["sizes"] == 0.2
    with pytest.raises(ConfigError, match="sizes is from 0 to 0.3"):
        MujocoConfig(world="counter", sizes=0.5)
    with pytest.raises(ConfigError, match="Only a counter's things"):
        MujocoConfig(world="kitchen", mirrored=True)


@pytest.mark.parametrize(("rung", "slot"), [(CounterTether(), "grasp_method"), (FetchRung(), "memory")])
def test_the_method_is_not_overridden(rung: CounterTether | FetchRung, slot: str) -> None:
    with pytest.raises(ConfigError, match=slot):
        rung.config(rung.default_methods[0], "ideal", {slot: "centroid"})


@pytest.mark.slow
def test_a_thing_is_taken_and_set_down() -> None:
    spec = TrialSpec("counter-tether", "reranked", "ideal", 4300, 0, case={"thing": "mug", "hand": "right"})
    outcome = CounterTether().run(spec, None)
    assert outcome.series["was_lifted"] == 1.0, outcome
