"""`golem compare`: two finished ladders on the same seeds, method by method: what does the harder rung cost?"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tyro.conf import Positional

from golem.errors import ConfigError
from golem.evaluation.harness.records import TrialRecord, read_records
from golem.evaluation.metrics.statistics import PairedTable, holm, mcnemar, paired_difference, wilson


@dataclass(frozen=True)
class CompareConfig:
    """Compare two ladder runs of the same seed and profile, e.g. rung tether with rung stand, by McNemar's test."""

    first: Positional[Path]
    """Run folder of one ladder."""
    second: Positional[Path]
    """Run folder of the other."""
    json: bool = False
    """Print the figures as a last line of JSON."""


def run_compare(config: CompareConfig) -> list[dict[str, Any]]:
    """Print, per method of both runs, the success rates and the paired test on the trials that both have.

    Raises:
        ConfigError: a folder holds no trials, or the two have nothing in common that can be compared.
        golem.errors.OutputError: a file is no trial record.
    """
    a, b = (_read(folder) for folder in (config.first, config.second))
    for name in ("seed", "profile"):
        one, other = getattr(a[0], name), getattr(b[0], name)
        if one != other:
            raise ConfigError(
                f"The runs have different {name}s ({one} and {other}); trials are paired by seed, index and profile."
            )
    for difference in _differences(a[0], b[0]):
        print(difference)
    methods = [m for m in dict.fromkeys(r.method for r in a) if m in {r.method for r in b}]
    if not methods:
        raise ConfigError("The runs have no method in common.")
    rungs = a[0].rung, b[0].rung
    found = [_paired(method, rungs, a, b) for method in methods]
    for row, adjusted in zip(found, holm([row["p"] for row in found]), strict=True):
        row["p_holm"] = adjusted
    print(text(found))
    if config.json:
        print(json.dumps(found))
    return found


def text(found: Sequence[dict[str, Any]]) -> str:
    """Return a few lines for a terminal."""
    lines: list[str] = []
    for row in found:
        sides = [
            f"{rung} {row[key]['successes']}/{row['n']} {100 * row[key]['rate']:.1f} % "
            f"[{100 * row[key]['interval'][0]:.1f}, {100 * row[key]['interval'][1]:.1f}]"
            for rung, key in zip(row["rungs"], ("first", "second"), strict=True)
        ]
        low, high = row["interval"]
        lines.append(
            f"{row['method']}: {sides[0]}, {sides[1]}; difference {100 * row['difference']:+.1f} points "
            f"[{100 * low:+.1f}, {100 * high:+.1f}], {row['only_first']} trials won only by the first, "
            f"{row['only_second']} only by the second, exact McNemar p = {row['p']:.2g}, "
            f"Holm-adjusted {row['p_holm']:.2g}"
        )
    return "\n".join(lines)


def _read(folder: Path) -> list[TrialRecord]:
    records = read_records(folder / "trials.jsonl")
    if not records:
        raise ConfigError(f"{folder} holds no trials; give the --out folder of a finished golem ladder.")
    return records


def _differences(a: TrialRecord, b: TrialRecord) -> list[str]:
    """Return what else differs between two runs, so that nobody takes it for the rung's or the method's doing."""
    found: list[str] = []
    if a.code != b.code:
        found.append(f"The runs are of different code, commits {a.commit} and {b.commit}.")
    if a.overrides != b.overrides:
        sides = (" ".join(f"{k}={v}" for k, v in r.overrides.items()) or "none" for r in (a, b))
        found.append(f"The runs have different --use: {' and '.join(sides)}.")
    for name in sorted(a.versions.keys() | b.versions.keys()):
        one, other = (r.versions.get(name, "none") for r in (a, b))
        if one != other:
            found.append(f"The runs have different versions of {name}: {one} and {other}.")
    return found


def _paired(
    method: str, rungs: tuple[str, str], a: Sequence[TrialRecord], b: Sequence[TrialRecord]
) -> dict[str, Any]:
    one, other = ({r.index: r.success for r in side if r.method == method} for side in (a, b))
    common = sorted(one.keys() & other.keys())
    if not common:
        raise ConfigError(f"The runs have no trial of method {method} in common.")
    wins = [one[i] for i in common], [other[i] for i in common]
    table = PairedTable.count(*wins)
    difference = paired_difference(table)
    return {
        "method": method,
        "rungs": list(rungs),
        "n": table.n,
        "first": _rate(wins[0]),
        "second": _rate(wins[1]),
        "only_first": table.only_a,
        "only_second": table.only_b,
        "difference": (table.only_a - table.only_b) / table.n,
        "interval": [difference.low, difference.high],
        "p": mcnemar(table),
    }


def _rate(wins: Sequence[bool]) -> dict[str, Any]:
    interval = wilson(sum(wins), len(wins))
    return {
        "successes": sum(wins),
        "rate": sum(wins) / len(wins),
        "interval": [interval.low, interval.high],
    }
