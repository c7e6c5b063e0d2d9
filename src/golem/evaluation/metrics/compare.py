"""`golem compare`: two finished ladders on the same seeds, method by method: what does the harder rung cost?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tyro.conf import Positional

from golem.errors import ConfigError
from golem.evaluation.base import Key
from golem.evaluation.harness.records import TrialRecord
from golem.evaluation.harness.run_folder import finished_records
from golem.evaluation.metrics.summary import Summary, comparisons_of, row
from golem.evaluation.metrics.tables import run_tables


@dataclass(frozen=True)
class CompareConfig:
    """Compare two ladder runs of the same seed and profile, e.g. rung tether with rung stand, by McNemar's test."""

    first: Positional[Path]
    """Run folder of one ladder."""
    second: Positional[Path]
    """Run folder of the other."""
    json: bool = False
    """Print the figures as a last line of JSON."""


def run_compare(config: CompareConfig) -> Summary:
    """Print success and metrics of the trials that both runs have, per method and case, with the paired tests.

    Raises:
        ConfigError: a folder holds no trials, or the two have nothing in common that can be compared.
        golem.errors.OutputError: a file is no trial record.
    """
    if config.first.resolve() == config.second.resolve():
        raise ConfigError(f"Both are {config.first}; name two run folders.")
    a, b = (finished_records(folder) for folder in (config.first, config.second))
    rungs = f"The runs are of two rungs, {a[0].rung} and {b[0].rung}, and" if a[0].rung != b[0].rung else "The runs"
    for name in ("seed", "profile"):
        one, other = getattr(a[0], name), getattr(b[0], name)
        if one != other:
            raise ConfigError(
                f"{rungs} have different {name}s ({one} and {other}); trials are paired by seed, index and profile."
            )
    if a[0].code != b[0].code:
        raise ConfigError(
            f"{rungs} are of different code, commits {a[0].commit} and {b[0].commit}; measure one of them again."
        )
    if a[0].rung != b[0].rung:
        print(f"{rungs.removesuffix(', and')}: the same draws in two tasks, trial by trial.")
    for difference in _differences(a[0], b[0]):
        print(difference)
    names = (a[0].rung, b[0].rung) if a[0].rung != b[0].rung else (config.first.name, config.second.name)
    one, other = ({r.key: r for r in side} for side in (a, b))
    if not {r.method for r in a} & {r.method for r in b}:
        raise ConfigError(f"{rungs} have no method in common.")
    groups: dict[tuple[str, str], list[Key]] = {}
    for key in sorted((key for key in one if key in other), key=lambda key: key[2]):
        groups.setdefault(key[:2], []).append(key)
    if not groups:
        raise ConfigError("The runs have no trial in common.")
    pairs = [(_named(one, keys, names[0]), _named(other, keys, names[1])) for keys in groups.values()]
    summary = Summary(tuple(row(side) for pair in pairs for side in pair), comparisons_of(pairs))
    print("\n\n".join(table.markdown() for table in run_tables(summary)))
    if config.json:
        print(summary.json())
    return summary


def _named(side: Mapping[Key, TrialRecord], keys: Sequence[Key], name: str) -> list[TrialRecord]:
    """Return records whose method says which run they are of."""
    return [replace(side[key], method=f"{key[0]} on {name}") for key in keys]


def _differences(a: TrialRecord, b: TrialRecord) -> list[str]:
    """Return what else differs between two runs, which must not be taken for an effect of the rung or the method."""
    found: list[str] = []
    if a.overrides != b.overrides:
        sides = (" ".join(f"{k}={v}" for k, v in r.overrides.items()) or "none" for r in (a, b))
        found.append(f"The runs have different --use: {' and '.join(sides)}.")
    for name in sorted(a.options.keys() & b.options.keys()):
        if a.options[name] != b.options[name]:
            option = name.replace("_", "-")
            found.append(f"The runs have different --{option}: {a.options[name]} and {b.options[name]}.")
    for name in sorted(a.versions.keys() | b.versions.keys()):
        one, other = (r.versions.get(name, "none") for r in (a, b))
        if one != other:
            found.append(f"The runs have different versions of {name}: {one} and {other}.")
    return found
