"""The errands of the counter rungs: drawn from the trial, always possible to ask for, judged by the truth."""

from __future__ import annotations

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.base import TrialSpec
from golem.evaluation.rungs.counter import CounterOptions, CounterTether, draw_errand
from golem.evaluation.rungs.fetch_errand import FetchRung
from golem.robots.worlds.kitchen import draw_counter
from golem.robots.worlds.tableware import KINDS


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
    others = [one.position[:2] for one in kitchen.things if one is not thing]
    assert np.linalg.norm(np.subtract(others, place), axis=1).min() > 0.1


def test_the_things_that_are_asked_for_are_tried_case_by_case() -> None:
    rung = CounterTether(CounterOptions(thing=("can", "bowl")))
    cases = rung.cases(lambda case: None)
    assert cases == [{"thing": "can"}, {"thing": "bowl"}]
    kitchen = draw_counter(np.random.default_rng(0))
    for case in cases:
        kind, hand, _ = draw_errand(
            TrialSpec("counter-tether", "centroid", "field", 1, 0, case=case), kitchen
        )
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


@pytest.mark.parametrize(("rung", "slot"), [(CounterTether(), "grasp_method"), (FetchRung(), "memory")])
def test_the_method_is_not_overridden(rung: CounterTether | FetchRung, slot: str) -> None:
    with pytest.raises(ConfigError, match=slot):
        rung.config(rung.default_methods[0], "ideal", {slot: "centroid"})


@pytest.mark.slow
def test_a_thing_is_taken_and_set_down() -> None:
    spec = TrialSpec("counter-tether", "reranked", "ideal", 4300, 0, case={"thing": "mug", "hand": "right"})
    outcome = CounterTether().run(spec, None)
    assert outcome.series["was_lifted"] == 1.0, outcome
