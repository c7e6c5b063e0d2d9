"""Runs the same trials with the compiled chain and with the nodes that it stands for, and compares their records.

    python scripts/chain_records.py -n 20 push:wbc stand:visual_servo tether:visual_servo

Exits with 1 where a trial ends at another stage, or where a figure differs by more than 1e-6 of itself.
"""

from __future__ import annotations

import argparse
import math
import sys
import time

from golem.evaluation.base import RUNGS, TrialOutcome, TrialSpec, make_rung
from golem.runtime import lockstep

CHAIN = lockstep.chain_of
SAME = 1e-6
"""Relative difference of two figures that counts as none."""


def run(spec: TrialSpec, chained: bool) -> tuple[TrialOutcome, float]:
    """Return the outcome of one trial and its CPU time [s]."""
    lockstep.chain_of = CHAIN if chained else lambda bus, nodes: None
    before = time.process_time()
    return make_rung(RUNGS[spec.rung]).run(spec, None), time.process_time() - before


def difference(one: TrialOutcome, other: TrialOutcome) -> float:
    """Return the largest relative difference of two outcomes' figures; inf where they end otherwise."""
    a, b = ({**outcome.timings, **outcome.series} for outcome in (one, other))
    if (one.stage, one.module, one.detail) != (other.stage, other.module, other.detail) or a.keys() != b.keys():
        return math.inf
    return max((abs(a[k] - b[k]) / max(abs(a[k]), abs(b[k])) for k in a if a[k] != b[k]), default=0.0)


def main() -> int:
    """Compare; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", type=int, default=20)
    parser.add_argument("--seed", type=int, default=46)
    parser.add_argument("rungs", nargs="+", help="rung:method")
    args = parser.parse_args()
    bad = 0
    for rung, method in (name.split(":") for name in args.rungs):
        worst, figures, won, with_it, without = 0.0, 0, 0, 0.0, 0.0
        case = make_rung(RUNGS[rung]).cases(lambda case: None)[0]
        for index in range(args.n):
            spec = TrialSpec(rung, method, "field", args.seed, index, case=case)
            (one, a), (other, b) = run(spec, True), run(spec, False)
            with_it, without, won = with_it + a, without + b, won + one.success
            figures += len(one.timings) + len(one.series)
            apart = difference(one, other)
            worst = max(worst, apart)
            if apart > SAME:
                bad += 1
                print(f"{rung} {index}: {one.stage!r} {one.detail!r} / {other.stage!r} {other.detail!r}")
        print(
            f"{rung} with {method}: {args.n} trials, {won} won, {figures} figures, largest relative difference "
            f"{worst:g}; CPU {with_it:.0f} s with the chain, {without:.0f} s without",
            flush=True,
        )
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main())
