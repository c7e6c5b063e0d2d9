"""Compare two lower bodies on the same seeds: the paper's rod pushes the robot. More trials: golem ladder."""

from __future__ import annotations

from golem.evaluation.base import RUNGS, TrialSpec, make_rung
from golem.evaluation.harness.trials import run_trial
from golem.evaluation.metrics.statistics import PairedTable, mcnemar, wilson

METHODS, TRIALS = ("almi", "wbc"), 1


def main() -> None:
    rung = make_rung(RUNGS["push"])
    stood: dict[str, list[bool]] = {}
    for method in METHODS:
        specs = [TrialSpec("push", method, "field", seed=0, index=i) for i in range(TRIALS)]
        stood[method] = [run_trial(rung, spec).success for spec in specs]
        rate = wilson(sum(stood[method]), TRIALS)
        print(f"{method}: {sum(stood[method])} of {TRIALS}, 95 % from {rate.low:.2f} to {rate.high:.2f}")
    pairs = list(zip(*stood.values(), strict=True))
    table = PairedTable(
        both=pairs.count((True, True)),
        only_a=pairs.count((True, False)),
        only_b=pairs.count((False, True)),
        neither=pairs.count((False, False)),
    )
    print(f"McNemar's test: p = {mcnemar(table):.2f}")


if __name__ == "__main__":
    main()
