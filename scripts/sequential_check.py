"""Checks the statistics of `--stop decided` on simulated studies, and writes the table of docs/reference/sequential.md.

    python scripts/sequential_check.py docs/reference/sequential.md --studies 10000 --seed 0

Type-I error of the e-processes when a comparison may end after any trial; coverage of the confidence sequence at all
times at once; and how many trials a difference of 20 points takes, beside tests for an n that was fixed in advance.
With `--step`, beside STEP as published (Snyder et al., arXiv 2503.10966): its package sequentialized_barnard_tests must
be on the import path, with its policy for 200 trials. It allows 5 % of error each way, so ours do in that table.
"""

from __future__ import annotations

import argparse
import importlib
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binom

from golem.evaluation.metrics.anytime import ALPHA, anytime_p, log_capital, paired_evidence, unpaired_evidence
from golem.types import Array

START, END = "<!-- sequential_check -->\n", "<!-- /sequential_check -->"
RATES = (0.02, 0.1, 0.5, 0.8, 0.9, 0.98)
PAIRS = ((0.5, 0.7), (0.7, 0.9), (0.75, 0.95), (0.8, 1.0))
SHARED = (0.0, 0.5, 0.9)
"""Share of what makes a trial hard that both methods meet alike."""
MOST = 400
PLANNED = 100
"""Trials of each method that a study plans; what early ends are compared with."""
STEP_MOST = 200
"""Trials for which STEP ships a policy at 5 %."""
BLOCK = 1000
"""Studies simulated at a time."""


def draws(rng: np.random.Generator, a: float, b: float, shared: float, studies: int, n: int) -> tuple[Array, Array]:
    """Return successes, each (studies, n), of two methods on scenes that are `shared` so far."""
    scene = rng.random((studies, n))
    own = np.where(rng.random((studies, n)) < shared, scene, rng.random((studies, n)))
    return (scene < a).astype(float), (own < b).astype(float)


def ends(p: Array, alpha: float = ALPHA) -> Array:
    """Return after how many trials each row of p-values that hold at any time is decided; inf where never."""
    found = p <= alpha
    return np.where(found.any(axis=1), found.argmax(axis=1) + 1.0, np.inf)


def errors(rng: np.random.Generator, studies: int) -> list[str]:
    """Return rows: false claims of a difference, and lost true means, in percent."""
    rows = [
        "| true success | paired, shared 0 / 0.5 / 0.9 | unpaired | scores, shared 0.5 | mean outside its sequence |"
    ]
    rows += ["|---|---|---|---|---|"]
    for rate in RATES:
        wrong = np.zeros(6)
        for _ in range(studies // BLOCK):
            for k, shared in enumerate(SHARED):
                a, b = draws(rng, rate, rate, shared, BLOCK, MOST)
                wrong[k] += np.isfinite(ends(anytime_p(paired_evidence(a, b)))).sum()
                if k == 0:
                    wrong[3] += np.isfinite(ends(anytime_p(unpaired_evidence(a, b)))).sum()
                    capital = log_capital(a, [rate])[..., 0].max(axis=1)
                    wrong[5] += (capital >= math.log(1 / ALPHA)).sum()
            share = rng.random((BLOCK, MOST))
            a, b = (share * s for s in draws(rng, rate, rate, 0.5, BLOCK, MOST))
            wrong[4] += np.isfinite(ends(anytime_p(paired_evidence(a, b)))).sum()
        percent = [f"{100 * x / (studies // BLOCK * BLOCK):.2f}" for x in wrong]
        rows.append(f"| {rate:g} | {' / '.join(percent[:3])} | {percent[3]} | {percent[4]} | {percent[5]} |")
    return rows


def fixed_n(rng: np.random.Generator, a: float, b: float, shared: float) -> tuple[int, int, int]:
    """Return the least n of McNemar's exact test with 80 and with 90 % power, and of Wilson's intervals apart, 80 %."""
    x, y = draws(rng, a, b, shared, BLOCK, MOST)
    n = np.arange(1.0, MOST + 1.0)
    won, lost = (np.cumsum(one, axis=1) for one in (x > y, y > x))
    told = 2.0 * binom.cdf(np.minimum(won, lost), won + lost, 0.5) <= ALPHA
    ends_x, ends_y = (wilson_ends(np.cumsum(one, axis=1), n) for one in (x, y))
    apart = ends_x[1] < ends_y[0]
    test, intervals = told.mean(axis=0), apart.mean(axis=0)
    found = [(test, 0.8), (test, 0.9), (intervals, 0.8)]
    first, second, third = (
        int(np.argmax(power >= wanted)) + 1 if power.max() >= wanted else MOST for power, wanted in found
    )
    return first, second, third


def wilson_ends(successes: Array, n: Array) -> tuple[Array, Array]:
    """Return the ends of Wilson's 95 % intervals; see `statistics.wilson`, which has them one by one."""
    z2 = 1.959964**2
    half = np.sqrt(z2 * (successes * (n - successes) / n + z2 / 4))
    return (successes + z2 / 2 - half) / (n + z2), (successes + z2 / 2 + half) / (n + z2)


def savings(rng: np.random.Generator, studies: int) -> list[str]:
    """Return rows: how many pairs it takes to find 20 points."""
    heads = ["success", "shared", "paired, median (mean)", f"saved of {PLANNED}, median", f"found within {PLANNED}"]
    heads += ["unpaired, median", "McNemar, n fixed, 80 / 90 %", "Wilson apart, 80 %"]
    rows = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for a, b in PAIRS:
        for shared in SHARED:
            x, y = draws(rng, a, b, shared, studies, MOST)
            found, other = ends(anytime_p(paired_evidence(x, y))), ends(anytime_p(unpaired_evidence(x, y)))
            spent = np.minimum(found, PLANNED)
            cells = [f"{a:g}, {b:g}", f"{shared:g}", f"{np.median(found):.0f} ({np.minimum(found, MOST).mean():.0f})"]
            cells += [f"{100 * (1 - np.median(spent) / PLANNED):.0f} %", f"{100 * np.mean(found <= PLANNED):.0f} %"]
            eighty, ninety, apart = fixed_n(np.random.default_rng(1), a, b, shared)
            cells += [f"{np.median(other):.0f}", f"{eighty} / {ninety}", f"{apart}"]
            rows.append(f"| {' | '.join(cells)} |")
    return rows


def beside_step(rng: np.random.Generator, studies: int) -> list[str]:
    """Return rows: median of the pairs until a decision, at most 200, by ours and by STEP as published."""
    tests: Any = importlib.import_module("sequentialized_barnard_tests")
    test = tests.MirroredStepTest(tests.Hypothesis.P0MoreThanP1, STEP_MOST, ALPHA)

    def end(one: Array, other: Array) -> int:
        test.reset()
        for i in range(STEP_MOST):
            if test.step(int(one[i]), int(other[i])).decision != tests.Decision.FailToDecide:
                return i + 1
        return STEP_MOST

    rows = ["| success | shared | paired, ours | unpaired, ours | STEP |", "|---|---|---|---|---|"]
    for a, b in PAIRS:
        for shared in SHARED:
            x, y = draws(rng, a, b, shared, studies, STEP_MOST)
            ours = [
                np.minimum(ends(anytime_p(f(x, y)), 2 * ALPHA), STEP_MOST) for f in (paired_evidence, unpaired_evidence)
            ]
            theirs = [end(one, other) for one, other in zip(x, y, strict=True)]
            cells = [f"{a:g}, {b:g}", f"{shared:g}", *(f"{np.median(n):.0f}" for n in (*ours, theirs))]
            rows.append(f"| {' | '.join(cells)} |")
    return rows


def main() -> None:
    """Write the tables between the marks of the page that is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", type=Path)
    parser.add_argument("--studies", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--step", type=int, default=0, metavar="STUDIES", help="beside STEP, in so many studies a row")
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    studies = options.studies
    parts = [
        f"*Type-I error and loss of coverage at any of {MOST} trials, in percent (5 allowed). {studies:,} "
        f"studies a cell, seed {options.seed}.*",
        "\n".join(errors(rng, studies)),
        f"*Pairs that 20 points take. {studies:,} simulated studies a row, error 5 %, at most {MOST} pairs.*",
        "\n".join(savings(rng, studies)),
        *(
            [
                f"*Median of the pairs until a decision, at most {STEP_MOST}, error 5 % each way. {options.step} "
                "simulated studies a row.*",
                "\n".join(beside_step(np.random.default_rng(options.seed + 1), options.step)),
            ]
            if options.step
            else []
        ),
        f"```sh\npython {' '.join(['scripts/sequential_check.py', *sys.argv[1:]])}\n```",
    ]
    text = options.page.read_text(encoding="utf-8")
    before, _, rest = text.partition(START)
    _, _, after = rest.partition(END)
    options.page.write_text(before + START + "\n" + "\n\n".join(parts) + "\n\n" + END + after, encoding="utf-8")


if __name__ == "__main__":
    main()
