"""`--stop decided`: a comparison ends when it is decided, at the same trial whatever the number of processes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.base import TrialOutcome
from golem.evaluation.harness.ladder import LadderConfig, run_ladder
from golem.evaluation.metrics.sequential import StopRule

Make = Callable[..., LadderConfig]


def counts(config: LadderConfig) -> Counter[str]:
    return Counter(r.method for r in run_ladder(config).records)


@pytest.mark.slow
def test_a_decided_comparison_ends_at_the_same_trial_whatever_j(fake: Make) -> None:
    one = fake("poor", "good", n=200, out="one", stop="decided")
    two = replace(one, out=one.out and one.out.with_name("two"), j=2)
    found = counts(one)
    assert found == counts(two)
    assert found["poor"] == found["good"] < 40
    assert one.out and two.out
    assert (one.out / "trials.jsonl").read_bytes() == (two.out / "trials.jsonl").read_bytes()


@pytest.mark.slow
def test_a_method_goes_on_while_one_of_its_comparisons_is_open(fake: Make) -> None:
    found = counts(fake("poor", "good", "slow", n=40, stop="decided", margin=0.02, j=2))
    assert found["good"] == found["slow"] == 40 > found["poor"]


def test_one_method_ends_when_its_rate_is_known(fake: Make) -> None:
    result = run_ladder(fake("sure", n=200, stop="decided", margin=0.15))
    assert len(result.records) < 40
    assert "At any time: betting confidence sequence" in result.text()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"margin": 0.0}, "--margin is 0; it is a share between 0 and 1"),
        ({"comparisons": 0}, "--comparisons is 0"),
        ({"rung": "climb", "method": ("weak",), "profile": "ideal"}, "chooses its own cases: leave out --stop decided"),
    ],
)
def test_what_cannot_be_decided_is_refused(fake: Make, options: dict[str, object], sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        run_ladder(replace(fake("good", stop="decided"), **options))  # pyright: ignore[reportArgumentType]


def test_a_score_that_is_no_share_is_refused() -> None:
    with pytest.raises(ConfigError, match="The score 'force' is not between 0 and 1"):
        StopRule(score="force").values([TrialOutcome(True, "done", series={"force": 12.0})])


def test_a_score_decides_where_success_says_nothing() -> None:
    rng = np.random.default_rng(0)
    good, poor = 0.6 + 0.4 * rng.random(100), 0.5 * rng.random(100)
    after = StopRule().decided_after(good, poor)
    assert after is not None and after < 40
    assert StopRule(margin=0.01).decided_after(good, good + 0.02 * (rng.random(100) - 0.5)) is None
