"""`golem blame`: lost trials of a ladder are run again with modules exchanged for truth: who lost how many."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from tyro.conf import Positional, arg

from golem.errors import ConfigError, check_known
from golem.evaluation.base import Key, rung_class
from golem.evaluation.blame.game import EXACT, Coalition, Points, Strata, coalitions, orders_of, points, shapley
from golem.evaluation.blame.oracles import ORACLES, NotHere
from golem.evaluation.harness.ladder import LadderConfig, prepare, read_ladder, run_ladder
from golem.evaluation.harness.records import Provenance, TrialRecord
from golem.evaluation.harness.run_folder import RunFolder, finished_records
from golem.evaluation.harness.trial_executor import TrialExecutor, make_executor
from golem.evaluation.harness.trial_runner import Request, Runner
from golem.evaluation.metrics.statistics import wilson
from golem.evaluation.metrics.text_table import TextTable
from golem.options import fill
from golem.output_file import write_file

FOLDER = "blame"
"""Within a run folder, where the trials with exchanged modules are."""


@dataclass(frozen=True)
class BlameConfig:
    """Say which modules lost the trials of finished ladder runs, by running the same trials with modules exchanged.

    Trials go to RUN/blame, with blame.json and blame.md, and are not run twice. Several runs, from the lowest rung up,
    give an error budget.
    """

    runs: Positional[tuple[Path, ...]]
    """Run folders of `golem ladder`."""
    only: Annotated[tuple[str, ...], arg(help_behavior_hint="(default: all that exchange something)")] = ()
    """Oracles to try, e.g. detections arms."""
    n: Annotated[int, arg(aliases=("-n",))] = 50
    """Lost trials of each method that are run again, the first ones."""
    harm: int = 40
    """Won trials of each method that are run again, to see what an exchange loses."""
    j: Annotated[int, arg(aliases=("-j",))] = 1
    """Processes that run trials at the same time."""
    executor: str = "local"
    """As of `golem ladder`."""
    limit: float = 600.0
    """As of `golem ladder` [s]."""


@dataclass(frozen=True, slots=True)
class BlameVerdict:
    """What was found of one method of a run.

    Attributes:
        singles: oracle -> lost trials that it wins, won trials that it loses (-1: not looked at), and its points.
        pairs, shares, total: of the oracles that matter: points of two, Shapley's share, points of all together.
        all_wins: lost trials that are won with everything exchanged.
    """

    rung: str
    method: str
    strata: Strata
    singles: dict[str, tuple[int, int, Points]]
    pairs: dict[str, Points]
    all_wins: int
    shares: dict[str, Points]
    total: Points

    @property
    def first(self) -> str | None:
        """The oracle with the largest share, if any is above 0."""
        best = max(self.shares, key=lambda name: self.shares[name].value, default=None)
        return best if best is not None and self.shares[best].value > 0.0 else None

    @property
    def proved(self) -> list[str]:
        """The oracles whose exchange alone is proved to win trials, the most points first."""
        found = [name for name, (_, _, one) in self.singles.items() if one.proved]
        return sorted(found, key=lambda name: -self.singles[name][2].value)

    def table(self) -> TextTable:
        """Return what is printed: what each exchange is worth alone, its share, and what two are worth."""
        s = self.strata
        rate = wilson(s.won / s.alike, s.n / s.alike)
        rows = [
            (name, ORACLES[name].words, f"{won} of {len(s.lost_run)}",
             f"{lost} of {len(s.won_run)}" if lost >= 0 else "-",
             *_cells(one), "yes" if one.proved else "", *_cells(self.shares.get(name)))
            for name, (won, lost, one) in self.singles.items()
        ]  # fmt: skip
        pairs = {**self.pairs, "all of a share above": self.total} if self.shares else {}
        rows += [(name, "", "", "", *_cells(one), "", "", "") for name, one in pairs.items()]
        how = "orders drawn" if len(self.shares) > EXACT else "all coalitions run"
        best = f"No module is proved to lose trials; first by share: {self.first or 'none'}."
        for name in self.proved[:1]:
            best = f"A better {name} buys the most: {self.singles[name][2].interval.text(100)} points."
        left = len(s.lost_run) - self.all_wins
        return TextTable(
            f"{self.rung}, {self.method}: {s.won} of {s.n} won, {rate.text(100)} %",
            ("exchanged", "for", "lost won", "won lost", "points", "95 %", "proved", f"share ({how})", "95 %"),
            tuple(rows),
            f"{best} With everything exchanged {left} of {len(s.lost_run)} lost trials are lost all the same.",
        )


def _cells(one: Points | None) -> tuple[str, str]:
    return ("", "") if one is None else (f"{100 * one.value:+.1f}", one.interval.text(100, "+"))


class Trials:
    """Runs the trials of one run folder again under coalitions of oracles."""

    def __init__(self, run: Path, records: Sequence[TrialRecord], config: BlameConfig, executor: TrialExecutor) -> None:
        self._run, self._first, self._executor = run, records[0], executor
        self._methods = tuple(dict.fromkeys(r.method for r in records))
        self._n = 1 + max(r.index for r in records)
        self._config = config
        self._asked: dict[Coalition, tuple[Request, Provenance]] = {}
        self.won: dict[Coalition, dict[Key, bool]] = {frozenset(): {r.key: r.success for r in records}}
        (request, now), first = self._prepare(frozenset()), self._first
        if request.rung.adaptive:
            raise ConfigError(f"Rung {request.rung.name} searches levels; golem blame takes rungs with fixed trials.")
        if (first.code, dict(first.versions)) != (now.code, dict(now.versions)):
            raise ConfigError(f"{run} was run by other code or packages, commit {first.commit}; run its ladder again.")
        changed = next((r.method for r in records if r.config != now.configs[r.method]), None)
        if changed is not None:
            raise ConfigError(f"{changed} has changed since {run} was run, or a file of it; run its ladder again.")

    def _prepare(self, exchanged: Coalition) -> tuple[Request, Provenance]:
        if exchanged not in self._asked:
            r, kind = self._first, rung_class(self._first.rung)
            use = dict(r.overrides)
            if exchanged:
                use["oracle"] = "+".join(filter(None, (use.get("oracle"), name_of(exchanged))))
            config = LadderConfig(
                rung=r.rung, method=self._methods, n=self._n, profile=r.profile, seed=r.seed, j=self._config.j,
                use=tuple(f"{slot}={value}" for slot, value in use.items()), limit=self._config.limit,
                executor=self._config.executor, options=fill("option of the run", kind.Options, r.options),
            )  # fmt: skip
            self._asked[exchanged] = prepare(config.whole())
        return self._asked[exchanged]

    def candidates(self) -> list[str]:
        """Return the oracles that exchange something in every method's stack."""
        found: list[str] = []
        for name in self._config.only or ORACLES:
            check_known("oracle", ORACLES, name)
            try:
                self._prepare(frozenset([name]))
                found.append(name)
            except NotHere as why:
                if self._config.only:
                    raise
                print(f"{self._run}: {why}", file=sys.stderr)
        return found

    def run(self, exchanged: Coalition, keys: Iterable[Key]) -> None:
        """Run the trials `keys` with oracles in the place of what is `exchanged`, unless they were."""
        if not exchanged:
            return
        (request, provenance), only = self._prepare(exchanged), frozenset(keys)
        request = replace(request, only=only)
        with RunFolder(self._run / FOLDER / name_of(exchanged)) as folder:
            held = folder.resume(request.example, provenance)
            if not only <= {record.key for record in held}:
                print(f"Exchanged: {name_of(exchanged)}", file=sys.stderr)
                command = f"golem blame {self._run}"
                held = Runner(request, provenance, folder, self._executor, command).run(held)
                folder.finish(held, self._methods)
                folder.state(command, provenance)
        self.won[exchanged] = {record.key: record.success for record in held}


def name_of(exchanged: Coalition) -> str:
    """Return what a coalition's folder is called: its oracles in the order of the table."""
    return "+".join(sorted(exchanged, key=list(ORACLES).index))


def judge(trials: Trials, method: str, names: Sequence[str], config: BlameConfig, rung: str) -> BlameVerdict:
    """Run what is needed of one method, and say what each exchange is worth.

    An exchange that wins no lost trial alone, and is not missed where all together win one, is not paired.
    """
    base = {key: won for key, won in trials.won[frozenset()].items() if key[0] == method}
    lost, won = ([key for key, success in base.items() if success is flag] for flag in (False, True))
    alike = max(sum(other[2] == key[2] for other in base) for key in base)
    again, harmed = lost[: config.n], won[:: max(1, -(-len(won) // max(config.harm, 1)))] if config.harm else []
    strata, keys = Strata(len(lost), len(won), tuple(again), tuple(harmed), alike), [*again, *harmed]
    run, everything = trials.run, frozenset(names)
    for who in (everything, *(frozenset([name]) for name in names)):
        run(who, again)

    def wins(who: Coalition) -> list[Key]:
        return [key for key in again if trials.won[who][key]]

    alone = {name: wins(frozenset([name])) for name in names}
    matter = [name for name in names if alone[name]]
    jointly = [key for key in wins(everything) if not any(key in keys for keys in alone.values())]
    if jointly:  # what only several together win: who is missed?
        for name in names:
            rest = everything - {name}
            run(rest, jointly)
            if name not in matter and not all(trials.won[rest][key] for key in jointly):
                matter.append(name)
    orders = orders_of(matter, np.random.default_rng(0))
    chosen = coalitions(orders)
    for who in (*chosen, *(frozenset([name]) for name in matter)):
        run(who, keys)

    def effect(who: Coalition, compared: int = 1) -> Points:
        return points(strata, {key: float(trials.won[who][key]) - float(base[key]) for key in keys}, compared)

    singles: dict[str, tuple[int, int, Points]] = {}
    for name in names:
        who, nothing = frozenset([name]), points(replace(strata, won_run=()), dict.fromkeys(again, 0.0), len(names))
        losses = sum(not trials.won[who][key] for key in harmed) if name in matter else -1
        singles[name] = len(alone[name]), losses, effect(who, len(names)) if name in matter else nothing
    each = {key: shapley(orders, lambda who, key=key: float(trials.won[who][key])) for key in keys}
    shares = {name: points(strata, {key: each[key][name] for key in keys}) for name in matter}
    pairs = {name_of(who): effect(who) for who in chosen if len(who) == 2}
    total = effect(frozenset(matter))
    return BlameVerdict(rung, method, strata, singles, pairs, len(wins(everything)), shares, total)


def after_ladder(words: list[str]) -> list[str]:
    """Run the ladder that `words` name by `--rung`, if they do; return the words of the blame of its run."""
    if not any(word.partition("=")[0] == "--rung" for word in words):
        return words
    ran = run_ladder(read_ladder(words)).config
    return [str(ran.out), "-j", str(ran.j), "--executor", ran.executor, "--limit", str(ran.limit)]


def run_blame(config: BlameConfig) -> int:
    """Run, print and write what each module is worth; returns how many verdicts there are.

    Raises:
        ConfigError: a folder is no finished run of this code, or an oracle is none.
        golem.errors.OutputError: records are torn, or of another version, or another process writes there.
    """
    if config.n < 1 or config.harm < 0:
        raise ConfigError("-n is 1 or more, and --harm 0 or more.")
    verdicts: list[BlameVerdict] = []
    with closing(make_executor(config.executor, config.j)) as executor:
        for run in config.runs:
            records = finished_records(run)
            trials = Trials(run, records, config, executor)
            names = trials.candidates()
            if not names:
                raise ConfigError(f"{run}: no oracle exchanges anything there.")
            found = [judge(trials, m, names, config, records[0].rung) for m in dict.fromkeys(r.method for r in records)]
            verdicts += found
            text = "\n\n".join(verdict.table().markdown() for verdict in found)
            write_file(run / FOLDER / "blame.md", text + "\n")
            rows = [{**asdict(one), "first": one.first, "proved": one.proved} for one in found]
            write_file(run / FOLDER / "blame.json", json.dumps(rows) + "\n")
    tables = [verdict.table() for verdict in verdicts]
    if len(config.runs) > 1:
        tables.append(budget(verdicts))
    print("\n\n".join(table.terminal() for table in tables))
    return len(verdicts)


def budget(verdicts: Sequence[BlameVerdict]) -> TextTable:
    """Return the error budget from rung to rung, of each method: success, and each module's share of what is lost."""
    names = list(dict.fromkeys(name for one in verdicts for name in one.shares))
    rows: list[tuple[str, ...]] = []
    for method in dict.fromkeys(one.method for one in verdicts):
        before: Mapping[str, float] = {}
        for one in (v for v in verdicts if v.method == method):
            s, now = one.strata, {name: p.value for name, p in one.shares.items()}
            lost = [(100.0 * now.get(name, 0.0), 100.0 * before.get(name, 0.0)) for name in names]
            cells = [f"{here:.1f} ({here - there:+.1f})" for here, there in lost]
            rest = (s.n - s.won) / s.n - one.total.value
            rate = f"{100 * s.won / s.n:.1f} {wilson(s.won / s.alike, s.n / s.alike).text(100)}"
            rows.append((method, one.rung, rate, *cells, f"{100 * rest:.1f}"))
            before = now
    note = "Shapley's shares of what is lost [%], in brackets what a rung adds; rest: what has no oracle, and chance."
    return TextTable("Error budget", ("method", "rung", "success", *names, "rest"), tuple(rows), note)
