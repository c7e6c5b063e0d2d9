"""When enough trials were run: the rule of `--stop decided`, and what may be said at any moment."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from golem.errors import ConfigError
from golem.evaluation.base import Case, TrialOutcome, case_name
from golem.evaluation.harness.records import TrialRecord
from golem.evaluation.metrics import anytime
from golem.evaluation.metrics.anytime import anytime_interval, anytime_p, difference_interval, equal_within, evidence
from golem.evaluation.metrics.statistics import Interval, holm, wilson
from golem.evaluation.metrics.summary import by_scene
from golem.evaluation.metrics.tables import p_value
from golem.evaluation.metrics.text_table import TextTable, short_names
from golem.types import Array


@dataclass(frozen=True, slots=True)
class StopRule:
    """When a comparison is decided.

    Attributes:
        margin: methods that differ by less are equal [share of trials]; one method alone is known when its interval is
            no wider than twice this.
        comparisons: how many the error of 5 % is divided among.
        score: name in `TrialOutcome.series` of a share from 0 to 1 that is compared; empty compares success.

    Raises:
        ConfigError: the margin is no share.
    """

    margin: float = 0.1
    comparisons: int = 1
    score: str = ""

    def __post_init__(self) -> None:
        if not 0.0 < self.margin < 1.0:
            raise ConfigError(f"--margin is {self.margin:g}; it is a share between 0 and 1, e.g. 0.1.")
        if self.comparisons < 1:
            raise ConfigError(f"--comparisons is {self.comparisons}; it must be 1 or more.")

    def values(self, trials: Sequence[TrialOutcome] | Sequence[TrialRecord]) -> Array:
        """Return what is compared of each trial, between 0 and 1. Raises ConfigError: the score is no share."""
        found = np.array([t.series.get(self.score, 0.0) if self.score else float(t.success) for t in trials])
        if len(found) and not (0.0 <= found.min() and found.max() <= 1.0):
            raise ConfigError(f"The score '{self.score}' is not between 0 and 1 in every trial; name a share.")
        return found

    def decided_after(self, a: Array, b: Array | None = None, *, paired: bool = True) -> int | None:
        """Return after how many trials of one method, or of two, it is decided; None if not yet.

        `paired` says that both saw the same scenes.
        """
        alpha = anytime.ALPHA / self.comparisons
        if not len(a):
            return None
        if b is None:
            low, high = anytime.confidence_sequence(a, alpha)
            done = high - low <= 2.0 * self.margin
        else:
            done = (anytime_p(evidence(a, b, paired)) <= alpha) | equal_within(a, b, self.margin, alpha)
        return int(np.argmax(done)) + 1 if done.any() else None

    def ends(self, values: Mapping[str, Array], n: int, ahead: int) -> dict[str, int]:
        """Return how many trials each method is to have, at most `n`.

        Args:
            values: method -> those of its trials 0, 1, ... without a gap.
            n: planned number.
            ahead: how many trials more than are there may be asked for where nothing is decided.
        """
        wanted = dict.fromkeys(values, 0)
        for pair in itertools.combinations(values, 2) if len(values) > 1 else [tuple(values)]:
            there = min(len(values[method]) for method in pair)
            after = self.decided_after(*(values[method][:there] for method in pair)) if there else None
            for method in pair:
                wanted[method] = max(wanted[method], min(n, there + ahead) if after is None else after)
        return wanted


@dataclass(frozen=True, slots=True)
class Decision:
    """Two sides, as they stand.

    Attributes:
        n: pairs.
        difference: confidence sequence's interval of a minus b.
        p: p-value that holds at any time.
        p_holm: the same, adjusted for all comparisons.
        after: pairs after which it was decided; None if it is not.
        equal: whether the rule refutes a difference of its margin or more; the interval has no more than its grid.
    """

    a: str
    b: str
    n: int
    difference: Interval
    p: float
    p_holm: float
    after: int | None
    equal: bool


Pair = tuple[str, str, Array, Array, bool]
"""Names of two sides, what is compared of their trials in the order of the indices they have in common, and whether
both saw the same scenes."""


def decisions(pairs: Sequence[Pair], rule: StopRule) -> tuple[Decision, ...]:
    """Return what is known of each pair, with Holm's adjustment over all, and over those of the rule still to come."""
    ps = [float(anytime_p(evidence(a, b, paired))[-1]) for *_, a, b, paired in pairs]
    alpha, adjusted = anytime.ALPHA / rule.comparisons, holm([*ps, *[1.0] * (rule.comparisons - len(ps))])
    return tuple(
        Decision(
            one, other, len(a), difference_interval(a, b), p, p_holm, rule.decided_after(a, b, paired=paired),
            bool(equal_within(a, b, rule.margin, alpha)[-1]),
        )
        for (one, other, a, b, paired), p, p_holm in zip(pairs, ps, adjusted, strict=False)
    )  # fmt: skip


def pairs_of(records: Sequence[TrialRecord], methods: Sequence[str], rule: StopRule) -> list[Pair]:
    """Return every pair of methods, case by case, over the trials that both have."""
    cases: dict[str, Case] = {case_name(r.case): r.case for r in records}
    found: list[Pair] = []
    for case in cases:
        sides = {m: by_scene([r for r in records if r.method == m and case_name(r.case) == case]) for m in methods}
        for a, b in itertools.combinations(methods, 2):
            pair = pair_of(f"{a}, {case}" if case else a, sides[a], f"{b}, {case}" if case else b, sides[b], rule)
            found += [pair] if pair else []
    return found


def pair_of(
    one: str, a: Mapping[int, Sequence[TrialRecord]], other: str, b: Mapping[int, Sequence[TrialRecord]], rule: StopRule
) -> Pair | None:
    """Return the scenes of two sides by the indices they have in common, each as the mean of its trials; None: no such.

    Of another seed the scenes are others, too.
    """
    both = sorted(a.keys() & b.keys())
    if not both:
        return None
    paired = all(a[i][0].seed == b[i][0].seed for i in both)
    x, y = (np.array([rule.values(side[i]).mean() for i in both]) for side in (a, b))
    return one, other, x, y, paired


def sequential_tables(rates: Mapping[str, Array], found: Sequence[Decision], rule: StopRule) -> list[TextTable]:
    """Return what holds at any time, beside what holds for a number that was fixed.

    Args:
        rates: name of a row -> what was measured of its trials.
        rule: by which trials were ended.
    """
    rows = [
        (name, str(len(x)), f"{100 * float(x.mean()):.1f}", _fixed(x).text(100.0), anytime_interval(x).text(100.0))
        for name, x in rates.items()
        if len(x)
    ]
    success = TextTable(
        f"{rule.score.replace('_', ' ').capitalize() or 'Success'} at any time",
        ("method", "n", "mean [%]", "95 %, n fixed in advance", "95 %, at any time"),
        tuple(rows),
        "At any time: betting confidence sequence (Waudby-Smith and Ramdas 2024), valid wherever a run stopped.",
    )
    tables = [success] if rows else []
    if found:
        short = short_names(name for d in found for name in (d.a, d.b))
        lines = [
            (
                f"{short[d.a]} against {short[d.b]}",
                str(d.n),
                d.difference.text(100.0, "+"),
                p_value(d.p),
                p_value(d.p_holm),
                _verdict(d, rule),
            )
            for d in found
        ]
        columns = ("pair", "pairs", "difference [points]", "p", "Holm-adjusted p", "verdict")
        note = f"By e-processes, valid after every trial; equal: within {100 * rule.margin:g} points."
        tables.append(TextTable("Comparison at any time", columns, tuple(lines), note))
    return tables


def _fixed(x: Array) -> Interval:
    return wilson(float(x.sum()), len(x)) if np.isin(x, (0.0, 1.0)).all() else anytime_interval(x, len(x))


def _verdict(d: Decision, rule: StopRule) -> str:
    if d.p_holm <= anytime.ALPHA:
        verdict = f"{'first' if d.difference.low + d.difference.high > 0.0 else 'second'} is better"
    elif d.equal or max(-d.difference.low, d.difference.high) <= rule.margin + 1e-9:
        verdict = "equal"
    else:
        return "open"
    return verdict if d.after is None else f"{verdict}, known after {d.after}"
