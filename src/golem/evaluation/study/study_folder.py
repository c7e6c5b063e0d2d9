"""A finished or growing study: its folder, its figures, and its tables."""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from golem.errors import ConfigError
from golem.evaluation.base import DONE, RUNGS, case_name, make_rung, rung_class
from golem.evaluation.harness.records import TrialRecord
from golem.evaluation.harness.run_folder import finished_records, read_facts
from golem.evaluation.metrics.anytime import anytime_interval
from golem.evaluation.metrics.published import PAPER
from golem.evaluation.metrics.sequential import Pair, StopRule, decisions, pair_of, pairs_of, sequential_tables
from golem.evaluation.metrics.statistics import Interval, clustered, wilson
from golem.evaluation.metrics.summary import by_scene
from golem.evaluation.metrics.text_table import TextTable, short_names

FACTS = "study.json"
EMPTY = "-"
WORDS = ("name", "title", "about", "by_construction", "command", "stop")
"""What the facts of a study say in words."""


@dataclass(frozen=True, slots=True)
class CellResult:
    """What a cell holds."""

    name: str
    folder: Path
    planned: int
    records: tuple[TrialRecord, ...]

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods, in the order of the records."""
        return tuple(dict.fromkeys(r.method for r in self.records))

    @property
    def adaptive(self) -> bool:
        """Whether its cases follow from results, so that a share of its trials says nothing."""
        return rung_class(self.records[0].rung).adaptive

    def of(self, method: str) -> list[TrialRecord]:
        """Return the trials of a method."""
        return [r for r in self.records if r.method == method]


@dataclass(frozen=True, slots=True)
class Study:
    """What a study folder, or the folder of one ladder, holds.

    Attributes:
        name, title, about, by_construction, command: in words.
        stop: by which trials were ended.
        rule: of its comparisons.
        compare: pairs of cells.
        cells: those that have trials.
        missing: names of those that have none yet.
    """

    name: str
    title: str
    about: str
    by_construction: str
    command: str
    stop: str
    rule: StopRule
    compare: tuple[tuple[str, str], ...]
    cells: tuple[CellResult, ...]
    missing: tuple[str, ...] = ()

    @property
    def commit(self) -> str:
        """The commit of all trials."""
        return self.cells[0].records[0].commit

    def rates(self) -> TextTable:
        """Return success by cell and method, and below each row what the paper has."""
        methods = list(dict.fromkeys(m for cell in self.cells for m in cell.methods))
        short, lines = short_names(methods), list[tuple[str, ...]]()
        for cell in self.cells:
            lines.append((cell.name, *(self._rate(cell, method) for method in methods)))
            rung = cell.records[0].rung
            figures = {m: PAPER.get((rung, m), ()) for m in methods}
            for label in dict.fromkeys(f.label for found in figures.values() for f in found):
                told = ([f for f in figures[m] if f.label == label] for m in methods)
                words = (
                    f"{100 * f[0].successes / f[0].n:.1f} {wilson(f[0].successes, f[0].n).text(100.0)}" if f else EMPTY
                    for f in told
                )
                lines.append((f"the paper, {label}", *words))
        how = (
            "95 % confidence sequences, valid wherever a comparison ended"
            if self.stop == "decided"
            else "95 % Wilson intervals"
        )
        parts = [
            f"Percent, {how}; n in brackets, after it what was planned where that was more.",
            self.by_construction,
            f"Not run: {', '.join(self.missing)}." if self.missing else "",
        ]
        return TextTable("", ("cell", *(short[m] for m in methods)), tuple(lines), " ".join(filter(None, parts)))

    def _rate(self, cell: CellResult, method: str) -> str:
        rows = cell.of(method)
        if not rows:
            return EMPTY
        if cell.adaptive:
            return "own table"
        n, planned = len(rows), cell.planned * len({case_name(r.case) for r in rows})
        rate, interval = self.success(cell, method)
        return f"{100 * rate:.1f} {interval.text(100.0)} ({f'{n} of {planned}' if n < planned else n})"

    def success(self, cell: CellResult, method: str) -> tuple[float, Interval]:
        """Return the rate of a method that has trials, with its interval: what shares a scene counts as one."""
        scenes = {index: [r.success for r in rows] for index, rows in by_scene(cell.of(method)).items()}
        rate = sum(map(sum, scenes.values())) / sum(map(len, scenes.values()))
        if self.stop == "decided":
            return rate, anytime_interval([sum(one) / len(one) for one in scenes.values()])
        return rate, clustered(list(scenes.values()))

    def pairs(self) -> list[Pair]:
        """Return every comparison of the study: methods within a cell, and a method in two cells."""
        found: list[Pair] = []
        for cell in self.cells:
            if not cell.adaptive:
                own = pairs_of(cell.records, cell.methods, self.rule)
                found += [(f"{cell.name}: {a}", b, one, other, same) for a, b, one, other, same in own]
        by_name = {cell.name: cell for cell in self.cells}
        for one, other in self.compare:
            if one in by_name and other in by_name:
                for method in by_name[one].methods:
                    a, b = by_name[one].of(method), by_name[other].of(method)
                    if both := {r.key for r in a} & {r.key for r in b}:  # else each cell has a case of its own
                        a, b = ([r for r in side if r.key in both] for side in (a, b))
                    pair = pair_of(f"{method}: {one}", by_scene(a), other, by_scene(b), self.rule)
                    found += [pair] if pair else []
        return found

    def comparisons(self) -> list[TextTable]:
        """Return what holds at any time, with Holm's adjustment over the whole study; first, adaptive rungs' own."""
        own = [
            replace(table, title=f"{cell.name}: {table.title}")
            for cell in self.cells
            if cell.adaptive
            for table in make_rung(RUNGS[cell.records[0].rung], cell.records[0].options).tables(
                {method: [(r.spec, r.outcome) for r in cell.of(method)] for method in cell.methods}
            )
        ]
        rates = {
            f"{cell.name}: {method}": self.rule.values(cell.of(method))
            for cell in self.cells
            for method in cell.methods
            if not cell.adaptive and len({case_name(r.case) for r in cell.of(method)}) == 1
        }
        return [*own, *sequential_tables(rates, decisions(self.pairs(), self.rule), self.rule)]

    def caption(self) -> str:
        """Return n, seeds, profiles and commit in a sentence."""
        records = [r for cell in self.cells for r in cell.records]
        counts = [len({r.index for r in cell.of(m)}) for cell in self.cells for m in cell.methods]
        n = f"{min(counts)}" if min(counts) == max(counts) else f"{min(counts)} to {max(counts)}"
        seeds, profiles = (", ".join(dict.fromkeys(str(getattr(r, of)) for r in records)) for of in ("seed", "profile"))
        return f"Profile {profiles}, n = {n} per method and cell, seed {seeds}, commit `{self.commit}`."

    def markdown(self) -> str:
        """Return what a document shows: caption, table of rates, command."""
        return f"*{self.title}. {self.caption()}*\n\n{self.rates().markdown()}\n\n```sh\n{self.command}\n```"

    def stages(self, cell: CellResult, method: str) -> dict[str, int]:
        """Return stage -> trials that were lost in it, most first."""
        lost = [r.stage for r in cell.of(method) if r.stage != DONE]
        return {stage: lost.count(stage) for stage in sorted(set(lost), key=lambda s: (-lost.count(s), s))}


def read_study(folder: Path) -> Study:
    """Return what a study folder holds, or the folder of one ladder, as a study of one cell.

    Raises:
        ConfigError: it holds no trials, its records are half-written, or are of several states of the code.
        golem.errors.OutputError: a file is no trial record, or another process writes to the folder.
    """
    facts = _facts(folder)
    if facts is None:
        records = tuple(finished_records(folder))
        command = str(read_facts(folder).get("command", ""))
        n = max(r.index for r in records) + 1
        cell = CellResult(folder.resolve().name, folder, n, records)
        study = Study(cell.name, f"Rung {records[0].rung}", "", "", command, "never", StopRule(), (), (cell,))
    else:
        cells = {name: folder / name for name in facts["cells"]}
        held = {name: path for name, path in cells.items() if (path / "trials.jsonl").is_file()}
        if not held:
            raise ConfigError(f"{folder} holds no trials yet; run its study first: {facts['command']}")
        results = tuple(CellResult(k, p, facts["cells"][k], tuple(finished_records(p))) for k, p in held.items())
        missing = tuple(name for name in cells if name not in held)
        words = {name: facts[name] for name in WORDS}
        study = Study(**words, rule=facts["rule"], compare=facts["compare"], cells=results, missing=missing)
    refuse_mixed([study])
    return study


def refuse_mixed(studies: Sequence[Study]) -> None:
    """Refuse what was measured with several states of the code: it is no comparison. Raises ConfigError: it was."""
    codes: dict[str, tuple[str, str]] = {}
    for cell, r in itertools.chain(*([(c, r) for c in s.cells for r in c.records] for s in studies)):
        codes.setdefault(r.code, (r.commit, str(cell.folder)))
    if len(codes) > 1:
        words = " and ".join(f"{commit} ({folder})" for commit, folder in list(codes.values())[:2])
        raise ConfigError(f"These trials are of different code, commits {words}; measure one of them again.")


def _facts(folder: Path) -> dict[str, Any] | None:
    try:
        facts = json.loads((folder / FACTS).read_text(encoding="utf-8"))
        words = {name: str(facts[name]) for name in WORDS}
        rule = StopRule(facts["margin"], facts["comparisons"], facts["score"])
        pairs = tuple((str(a), str(b)) for a, b in facts["compare"])
        return {**words, "rule": rule, "compare": pairs, "cells": {str(k): int(n) for k, n in facts["cells"].items()}}
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError, KeyError, AttributeError, ConfigError) as error:
        raise ConfigError(f"{folder / FACTS} is no study: {error!r}; run the study again.") from error
