"""`golem study`: every ladder of a study file into one folder, resumable; its plan; and its tables in documents."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from tyro.conf import Positional, arg

from golem.errors import ConfigError, MissingExtra, OutputError
from golem.evaluation.base import rung_class
from golem.evaluation.harness.ladder import LadderInterrupted, prepare, run_ladder
from golem.evaluation.harness.run_folder import RunFolder, read_costs
from golem.evaluation.metrics.anytime import ALPHA, anytime_p, equal_within, paired_evidence
from golem.evaluation.metrics.results import trials_csv
from golem.evaluation.metrics.sequential import decisions
from golem.evaluation.metrics.statistics import PairedTable, mcnemar, wilson
from golem.evaluation.metrics.text_table import TextTable
from golem.evaluation.study.study_file import Cell, StudyFile, read_study_file
from golem.evaluation.study.study_folder import FACTS, Study, read_study, refuse_mixed
from golem.output_file import write_file
from golem.provenance import code_files, command_line, commit, digest
from golem.types import Array

STUDIES = 1000
"""Simulated comparisons, seed 0."""
POWER = 0.8
LIKELY = 0.8
"""Success of the better method where nothing is known; a scene counts half for both (correlation of the draws)."""
STEPS = np.arange(0.05, 0.85, 0.05)
"""Differences of success that are tried."""
HOUR = 3600.0


def plan_table(study: StudyFile, cells: Sequence[Cell], comparisons: int) -> TextTable:
    """Return a row per cell: trials, hours on this machine, and the difference it finds with 80 % power.

    CPU seconds per trial are those of the records in the cell's folder; where it has none, trial 0 of each method is
    run there and kept.
    """
    rows, hours, trials = list[tuple[str, ...]](), 0.0, 0
    for cell in cells:
        n, m = cell.config.n or 0, len(cell.config.method)
        request = prepare(cell.config)[0]
        each = 1 if request.rung.adaptive else len(request.rung.cases(lambda case: None))
        count, cpu = n * m * each + max(0, (cell.best_n or n) - n) * min(m, 2) * each, _seconds(cell)
        cost = count * cpu / HOUR / max(cell.config.j, 1)
        hours, trials = hours + cost, trials + count
        finds = smallest_difference(n, comparisons) if m > 1 else wilson(LIKELY * n, n).high - wilson(LIKELY * n, n).low
        median = _median_end(study, n, comparisons, finds) if study.stop == "decided" and m > 1 else None
        rows.append(
            (
                cell.name, str(m), str(n), str(count), f"{cpu:.1f}", f"{cost:.2f}",
                "-" if median is None else str(median),
                f"{'width ' if m == 1 else ''}{100 * finds:.0f}" if finds < 1.0 else "none",
            )
        )  # fmt: skip
    rows.append(("all", "", "", str(trials), "", f"{hours:.2f}", "-", "-"))
    return TextTable(
        f"Plan of {study.title}",
        ("cell", "methods", "n", "trials at most", "CPU s a trial", "hours at most", "decided after", "finds"),
        tuple(rows),
        f"Hours with -j {cells[0].config.j} here. Finds [points], with {100 * POWER:.0f} % power by McNemar over "
        f"{comparisons} comparisons, the better at {100 * LIKELY:.0f} % or more; of one method: width of its interval. "
        f"Decided after: median of pairs at that difference with `stop: decided`. {STUDIES} simulated studies.",
    )


def smallest_difference(n: int, comparisons: int) -> float:
    """Return the least of `STEPS` that n pairs find with `POWER`; 1 where none is."""
    for step in STEPS:
        a, b = simulated(float(step), n)
        ps = {}
        won, lost = (a > b).sum(axis=1), (b > a).sum(axis=1)
        for pair in zip(won.tolist(), lost.tolist(), strict=True):
            ps.setdefault(pair, mcnemar(PairedTable(0, *pair, 0)))
        power = np.mean([ps[pair] <= ALPHA / comparisons for pair in zip(won.tolist(), lost.tolist(), strict=True)])
        if power >= POWER:
            return float(step)
    return 1.0


def simulated(difference: float, n: int, seed: int = 0) -> tuple[Array, Array]:
    """Return successes, each (STUDIES, n), of two methods so far apart that share half of what makes a scene hard."""
    rng = np.random.default_rng(seed)
    better = max(LIKELY, difference + 0.05)
    scene = rng.random((STUDIES, n))
    own = np.where(rng.random((STUDIES, n)) < 0.5, scene, rng.random((STUDIES, n)))
    return (scene < better).astype(float), (own < better - difference).astype(float)


def _median_end(study: StudyFile, n: int, comparisons: int, difference: float) -> int:
    """Return after how many pairs a comparison ends, at the median."""
    a, b = simulated(min(difference, 0.9), n)
    alpha = ALPHA / comparisons
    done = (anytime_p(paired_evidence(a, b)) <= alpha) | equal_within(a, b, study.margin, alpha)
    return int(np.median(np.where(done.any(axis=1), done.argmax(axis=1) + 1, n)))


def _seconds(cell: Cell) -> float:
    assert cell.config.out is not None
    costs = read_costs(cell.config.out)
    if not costs:
        run_ladder(replace(cell.config, n=1, stop="never"))
        costs = read_costs(cell.config.out)
    return math.fsum(float(line["cpu"]) for line in costs) / len(costs)


BEST = 2
"""So many methods of a cell go on to `best_n`."""
_BLOCK = re.compile(r"(<!-- study: (\S+) -->\n).*?(<!-- /study -->)", re.S)


@dataclass(frozen=True)
class StudyConfig:
    """Run every ladder of a study file into one folder; the same command continues it. Or write its tables.

    The folder gets a ladder's folder per cell, study.md, study.html, and trials.csv.
    """

    paths: Positional[tuple[Path, ...]]
    """The study file. With --tables: the folder that holds studies by name, then the Markdown files to write to."""
    out: Annotated[Path | None, arg(metavar="PATH", help_behavior_hint="(default: runs/studies/NAME)")] = None
    """Folder for the results."""
    n: Annotated[int | None, arg(aliases=("-n",), metavar="INT", help_behavior_hint="(default: the file's)")] = None
    """Trials per method in every cell, e.g. 1 to see whether everything runs."""
    j: Annotated[int, arg(aliases=("-j",))] = 1
    """Processes that run trials at the same time."""
    executor: str = "local"
    """Where trials run: local, or dask:ADDRESS."""
    limit: float = 600.0
    """Time after which a trial is ended, see golem ladder [s]."""
    plan: bool = False
    """Instead, say how many trials and hours it takes here, and what differences it can find."""
    tables: bool = False
    """Instead, write the tables of studies between `<!-- study: NAME -->` and `<!-- /study -->` in documents."""

    def command(self) -> str:
        """Return the command line that runs this."""
        words = command_line("golem study", replace(self, paths=(), plan=False))
        return words.replace("--paths", self.paths[0].as_posix(), 1)


def run_study_command(config: StudyConfig) -> Study | None:
    """Run, plan, or write tables.

    Raises:
        ConfigError: an option, the file, or what a folder holds says what cannot be.
        golem.errors.GolemError: see `run_ladder`.
    """
    if config.tables:
        if len(config.paths) < 2:
            raise ConfigError("golem study --tables needs a folder of studies and at least one Markdown file.")
        for page in config.paths[1:]:
            _write_tables(config.paths[0], page)
        return None
    if len(config.paths) != 1:
        raise ConfigError(
            f"golem study takes one study file, not {len(config.paths)}; with --tables, a folder and pages."
        )
    path = config.paths[0]
    study, cells = read_study_file(path)
    out = config.out or Path("runs/studies") / path.stem
    cells = tuple(_placed(cell, config, out) for cell in cells)
    for cell in cells:
        try:
            prepare(cell.config)
        except ConfigError as error:
            raise ConfigError(f"{path}, cell '{cell.name}': {error}") from error
    if config.plan:
        print(plan_table(study, cells, family(study, cells)).terminal(120))
        return None
    with RunFolder(out):
        try:
            return run_cells(config, study, cells, out)
        except LadderInterrupted:
            raise LadderInterrupted(f"Stopped; finished trials are kept; continue with: {config.command()}") from None


def run_cells(config: StudyConfig, study: StudyFile, cells: Sequence[Cell], out: Path) -> Study:
    """Run what is not there yet, and write the report."""
    comparisons = family(study, cells)
    _state(config, study, cells, out, comparisons)
    rejected = 0
    for cell in cells:
        print(f"Cell {cell.name}: {', '.join(cell.config.method)}", flush=True)
        # What is refuted already leaves its share of the error to the others (Holm, step by step).
        ladder = replace(cell.config, comparisons=max(1, comparisons - rejected) if study.stop == "decided" else None)
        result = run_ladder(ladder)
        if cell.best_n is not None and cell.best_n > (ladder.n or 0):
            best = sorted(result.summary.rows, key=lambda row: -row.rate)[:BEST]
            methods = tuple(m for m in ladder.method if m in {row.method for row in best})
            rule, sides = ladder.rule(), [[r for r in result.records if r.method == m] for m in methods]
            both = min(map(len, sides))
            if study.stop == "never" or rule.decided_after(*(rule.values(side[:both]) for side in sides)) is None:
                run_ladder(replace(ladder, method=methods, n=cell.best_n))
        if study.stop == "decided":
            found = read_study(out)
            rejected = sum(d.p_holm <= ALPHA for d in decisions(found.pairs(), found.rule))
    found = read_study(out)
    tables = "\n\n".join(table.markdown() for table in found.comparisons())
    write_file(out / "study.md", f"# {found.title}\n\n{found.about}\n\n{found.markdown()}\n\n{tables}\n")
    write_file(out / "trials.csv", trials_csv([r for cell in found.cells for r in cell.records]))
    print(found.rates().terminal(120))
    try:
        from golem.evaluation.report.site import study_page

        print(f"Report: {write_file(out / 'study.html', study_page(found))}")
    except MissingExtra as missing:
        print(f"No page was written: {missing}")
    return found


def family(study: StudyFile, cells: Sequence[Cell]) -> int:
    """Return how many comparisons a study makes: what Holm's adjustment is over."""
    count = 0
    for cell in cells:
        m, rung = len(cell.config.method), prepare(cell.config)[0].rung
        if not rung.adaptive:
            count += m * (m - 1) // 2 * len(rung.cases(lambda case: None))
    methods = {cell.name: set(cell.config.method) for cell in cells}
    return max(1, count + sum(len(methods[a] & methods[b]) for a, b in study.compare))


def _placed(cell: Cell, config: StudyConfig, out: Path) -> Cell:
    c = cell.config
    timed = rung_class(c.rung).timed
    ladder = replace(
        c, n=config.n or c.n, out=out / cell.name, limit=config.limit,
        j=1 if timed else config.j, executor="local" if timed else config.executor,
    )  # fmt: skip
    return replace(cell, config=ladder, best_n=None if config.n else cell.best_n)


def _state(config: StudyConfig, study: StudyFile, cells: Sequence[Cell], out: Path, comparisons: int) -> None:
    """Write what the folder is of; refuse one of another study or of other code."""
    code = digest(code_files())
    try:
        before = json.loads((out / FACTS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        before = {}
    if before.get("code", code) != code:
        raise OutputError(
            f"{out} is of other code, commit {before['commit']}; this is {commit()}. A study is of one state: choose "
            "another --out."
        )
    facts = {
        "name": config.paths[0].stem, "title": study.title, "about": study.about,
        "by_construction": study.by_construction, "command": config.command(), "commit": commit(), "code": code,
        "stop": study.stop, "margin": study.margin, "score": study.score, "comparisons": comparisons,
        "compare": [list(pair) for pair in study.compare], "cells": {cell.name: cell.config.n for cell in cells},
    }  # fmt: skip
    write_file(out / FACTS, json.dumps(facts, indent=1) + "\n")


def _write_tables(folder: Path, page: Path) -> None:
    try:
        text = page.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise OutputError(f"Cannot read {page}: {error}.") from error
    names = [match[2] for match in _BLOCK.finditer(text)]
    if not names or text.count("<!-- study:") != len(names):
        raise ConfigError(f"{page} needs lines '<!-- study: NAME -->', each with a line '<!-- /study -->' after it.")
    studies = {name: read_study(folder / name) for name in names}
    refuse_mixed(list(studies.values()))
    found = _BLOCK.sub(lambda match: f"{match[1]}{studies[match[2]].markdown()}\n{match[3]}", text)
    write_file(page, found)
    print(f"{page}: {', '.join(studies)}")
