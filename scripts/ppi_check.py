"""Coverage and width of prediction-powered intervals: `python scripts/ppi_check.py`.

Real and simulated outcomes of one cell are 0 or 1 with a given correlation (both are thresholds of one cell of a 2 x 2
table); the simulation may be biased. What it prints is the table of docs/how-to/blame.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import tyro

from golem.evaluation.metrics.prediction_powered import prediction_powered
from golem.evaluation.metrics.text_table import TextTable


@dataclass(frozen=True)
class CheckConfig:
    """Measure coverage over the correlation of simulation and reality."""

    studies: int = 4000
    """Studies of each kind."""
    n: tuple[int, ...] = (30, 60)
    """Real trials, each paired with a simulated one."""
    others: int = 500
    """Simulated trials beside them."""
    rates: tuple[float, ...] = (0.3, 0.5, 0.7, 0.87)
    """Real success rates; the simulation's is the same, or `bias` higher."""
    bias: tuple[float, ...] = (0.0, 0.1)
    """What the simulation promises too much."""
    seed: int = 0
    """Of the draws."""


def joint(p: float, q: float, r: float) -> tuple[float, float, float] | None:
    """Return P(both), P(only real), P(only simulated) for rates `p`, `q` and correlation `r`; None: none has it."""
    both = p * q + r * math.sqrt(p * (1.0 - p) * q * (1.0 - q))
    cells = both, p - both, q - both
    return cells if min(*cells, 1.0 - p - q + both) >= -1e-12 else None


def main(config: CheckConfig) -> None:
    """Print a row per correlation and number of real trials, over all rates and biases that allow it."""
    rng = np.random.default_rng(config.seed)
    rows: list[tuple[str, ...]] = []
    for n in config.n:
        for r in np.arange(0.0, 0.95, 0.1):
            covered, wilson_covered, widths, alone, excess, cells = [0.0] * 0, [0.0] * 0, [0.0] * 0, [0.0] * 0, 0.0, 0
            for p in config.rates:
                for bias in config.bias:
                    q = min(p + bias, 0.97)
                    table = joint(p, q, float(r))
                    if table is None:
                        continue
                    cells += 1
                    both, only, other = (max(x, 0.0) for x in table)
                    for _ in range(config.studies):
                        kind = rng.choice(4, n, p=[both, only, other, max(1.0 - both - only - other, 0.0)])
                        y, f = kind < 2, (kind == 0) | (kind == 2)
                        found = prediction_powered(
                            y.astype(float).tolist(), f.astype(float).tolist(),
                            (rng.random(config.others) < q).astype(float).tolist(),
                        )  # fmt: skip
                        covered.append(found.interval.low <= p <= found.interval.high)
                        wilson_covered.append(found.real.low <= p <= found.real.high)
                        widths.append(found.interval.high - found.interval.low)
                        alone.append(found.real.high - found.real.low)
                        excess = max(excess, widths[-1] - alone[-1])
            rows.append(
                (str(n), f"{r:.1f}", str(cells), *(f"{100 * x:.1f}" for x in (
                    np.mean(covered), np.mean(wilson_covered), np.median(widths), np.median(alone), excess)))
            )  # fmt: skip
            print(rows[-1], flush=True)
    columns = ("real trials", "correlation", "cells", "coverage [%]", "of Wilson's", "median width", "of Wilson's",
               "at most wider")  # fmt: skip
    title = f"{config.studies} studies a cell, {config.others} more simulated trials, seed {config.seed}"
    print(TextTable(title, columns, tuple(rows)).markdown())


if __name__ == "__main__":
    main(tyro.cli(CheckConfig))
