"""How often the intervals of golem blame hold, and a sound stack is blamed: `python scripts/blame_coverage.py`.

Trials are drawn, not run: an exchange wins a share of them and loses another, by luck or for good. What it prints is
the table of docs/how-to/blame.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import tyro

from golem.evaluation.blame.game import Points, Strata, points
from golem.evaluation.metrics.text_table import TextTable

CELLS = ((0.0, 0.0), (0.02, 0.02), (0.05, 0.05), (0.1, 0.0), (0.2, 0.0), (0.2, 0.05), (0.4, 0.0), (0.4, 0.1))
"""Shares of trials that an exchange wins, and loses."""


@dataclass(frozen=True)
class CoverageConfig:
    """Draw runs, and see what golem blame says of them."""

    runs: int = 4000
    """Runs of each kind."""
    n: tuple[int, ...] = (30, 50, 100)
    """Trials of a run."""
    harm: int = 40
    """Won trials that are run again."""
    oracles: int = 10
    """Oracles that are tried; in a null run all of them are alike, and independent."""
    lost: float = 0.1
    """Share of trials that nothing wins."""
    seed: int = 0
    """Of the draws."""


def drawn(rng: np.random.Generator, n: int, won: float, lost: float, config: CoverageConfig) -> Points:
    """Return what is said of one exchange in one run."""
    kind = rng.choice(4, n, p=(won, lost, config.lost, 1.0 - won - lost - config.lost))
    again = tuple(np.flatnonzero((kind == 0) | (kind == 2)).tolist())
    held = tuple(np.flatnonzero((kind == 1) | (kind == 3)).tolist())
    sample = held[: config.harm]
    gains = {i: float(kind[i] == 0) - float(kind[i] == 1) for i in (*again, *sample)}
    return points(Strata(len(again), len(held), again, sample), gains, config.oracles)


def main(config: CoverageConfig) -> None:
    """Print a row per kind of exchange and number of trials."""
    rng = np.random.default_rng(config.seed)
    rows: list[tuple[str, ...]] = []
    for n in config.n:
        for won, lost in CELLS:
            found = [drawn(rng, n, won, lost, config) for _ in range(config.runs)]
            held = np.mean([p.interval.low - 1e-9 <= won - lost <= p.interval.high + 1e-9 for p in found])
            proved = float(np.mean([p.proved for p in found]))
            any_of = f"{100 * (1.0 - (1.0 - proved) ** config.oracles):.2f}" if won == lost else "-"
            half = np.median([p.interval.high - p.interval.low for p in found]) / 2.0
            rows.append((str(n), f"{100 * won:.0f}", f"{100 * lost:.0f}", f"{100 * held:.1f}", f"{100 * half:.0f}",
                         f"{100 * proved:.1f}", any_of))  # fmt: skip
    columns = ("trials", "wins [%]", "loses [%]", "interval holds [%]", "half width, median", "proved [%]",
               "one of all wrongly proved [%]")  # fmt: skip
    title = f"{config.runs} runs each, harm {config.harm}, {config.oracles} oracles, seed {config.seed}"
    print(TextTable(title, columns, tuple(rows)).markdown())


if __name__ == "__main__":
    main(tyro.cli(CoverageConfig))
