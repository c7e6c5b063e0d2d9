"""`golem ladder`: every method of a rung on the same seeds, in parallel, resumable."""

from __future__ import annotations

import inspect
import signal
import sys
import threading
from collections.abc import Generator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, make_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import tyro
from tyro.conf import Suppress, arg

from golem.errors import ConfigError, MissingExtra, check_known, unknown_name
from golem.evaluation.base import RUNGS, Rung, TrialSpec, case_name, make_rung, option_values, rung_class
from golem.evaluation.harness.arguments import replaced_modules
from golem.evaluation.harness.records import Provenance, TrialRecord, read_records, trial_name
from golem.evaluation.harness.run_folder import RunFolder, read_costs
from golem.evaluation.harness.trial_executor import make_executor
from golem.evaluation.harness.trial_runner import Request, Runner
from golem.evaluation.harness.trials import facts
from golem.evaluation.metrics.sequential import StopRule, decisions, pairs_of, sequential_tables
from golem.evaluation.metrics.summary import Summary, summarise
from golem.evaluation.metrics.tables import all_cases, comparisons, losses, metrics, rates
from golem.evaluation.metrics.text_table import TextTable, short_names
from golem.provenance import code_files, command_line, commit, versions

OPEN = "(default: the rung's)"
AHEAD = 32
"""Trials of a method that are in flight on a cluster while it is open whether they are needed."""


@dataclass(frozen=True)
class LadderConfig:
    """Compare methods on one rung of the capability ladder, on the same seeds.

    The output folder gets trials.jsonl (one line per trial), report.html, summary.json and pictures. An interrupted
    run continues where it stopped when the same command is given again.
    """

    rung: str = "tether"
    """Rung of the ladder; with it, --help lists the rung's own options, too."""
    method: Annotated[tuple[str, ...], arg(help_behavior_hint=OPEN)] = ()
    """Methods to compare: names, file.py:Class, or with options "{use: NAME, option: value}"; legs also as
    policy:DESCRIPTION:NETWORK."""
    n: Annotated[int | None, arg(aliases=("-n",), metavar="INT", help_behavior_hint=OPEN)] = None
    """Trials per method, and per case where the rung has several."""
    profile: Annotated[str | None, arg(metavar="STR", help_behavior_hint=OPEN)] = None
    """Realism of sensors and world: ideal, bench or field."""
    seed: int = 0
    """Seed of the run; trial i of every method sees the same scene."""
    out: Annotated[Path | None, arg(metavar="PATH", help_behavior_hint="(default: runs/RUNG)")] = None
    """Folder for the results."""
    j: Annotated[int, arg(aliases=("-j",))] = 1
    """Processes that run trials at the same time; the records do not depend on it."""
    use: tuple[str, ...] = ()
    """Replace other modules of the stack: slot=implementation, e.g. upper_body=my_ik.py:MyIk, or with options
    "localizer={use: onnx, threshold: 0.7}"."""
    executor: str = "local"
    """Where trials run: local, or dask:ADDRESS of a scheduler whose workers have the same code."""
    limit: float = 600.0
    """Time after which a trial is ended and counts as lost [s]: what it computes and sleeps, not what a busy machine
    lets it wait."""
    stop: Literal["never", "decided"] = "never"
    """decided: end each comparison once it is, and a method alone once its rate is known to the margin; -n is then the
    most. The tables say what holds at any time."""
    margin: float = 0.1
    """Methods whose success differs by less are equal [share of trials]."""
    score: Annotated[str, arg(metavar="STR", help_behavior_hint="(default: success)")] = ""
    """With --stop decided: compare this metric of a trial, a share between 0 and 1."""
    comparisons: Annotated[int | None, arg(metavar="INT", help_behavior_hint="(default: those of this run)")] = None
    """With --stop decided: among how many comparisons the error of 5 % is divided."""
    show: Annotated[str | None, arg(metavar="TRIAL", help_behavior_hint="")] = None
    """Run nothing but this trial, in the live view: INDEX, METHOD:INDEX, or its name in the report."""
    json: bool = False
    """Print the summary as a last line of JSON."""
    options: Annotated[Any, Suppress] = None
    """The rung's own options, see `Rung.Options`; None are its defaults."""

    def whole(self) -> LadderConfig:
        """Return the configuration, what is left open by the rung's defaults. Raises ConfigError: no such rung."""
        kind = rung_class(self.rung)
        return replace(
            self,
            method=self.method or kind.default_methods,
            n=kind.default_n if self.n is None else self.n,
            profile=self.profile or kind.default_profile,
            out=self.out or Path("runs") / self.rung,
            options=kind.Options() if self.options is None else self.options,
        )

    def command(self) -> str:
        """Return the command line that runs this configuration."""
        return command_line("golem ladder", self.whole(), always=("rung", "seed"))

    def rule(self, cases: int = 1) -> StopRule:
        """Return by what comparisons of so many `cases` are decided. Raises ConfigError: an option of it cannot be."""
        own = max(1, len(self.method) * (len(self.method) - 1) // 2) * cases
        return StopRule(self.margin, own if self.comparisons is None else self.comparisons, self.score)


@dataclass(frozen=True, slots=True)
class LadderResult:
    """What a finished ladder found.

    Attributes:
        config: what was asked, with the rung's defaults.
        records: its trials, in canonical order.
        own: the tables of the rung's own.
        report: path of the HTML report; None where what draws it is not installed.
        note: why there is none.
    """

    config: LadderConfig
    out: Path
    records: tuple[TrialRecord, ...]
    summary: Summary
    own: tuple[TextTable, ...]
    report: Path | None
    note: str = ""

    def text(self, width: int = 100) -> str:
        """Return the tables for a terminal of `width` characters; what counts comes last, above the prompt."""
        s, adaptive = self.summary, rung_class(self.config.rung).adaptive
        lost = losses(self.records)
        standard = (metrics(s, brief=True), *self.own, lost, rates(s), all_cases(s), comparisons(s))
        shown = (*self.own, lost) if adaptive else standard
        return "\n\n".join(table.terminal(width) for table in shown if table is not None)


class LadderInterrupted(KeyboardInterrupt):
    """The user pressed Ctrl-C, or the system asked to end; the message says how to go on. What finished is kept."""


def read_ladder(words: list[str]) -> LadderConfig:
    """Return what the words of a command line mean, with the rung's own options. Raises ConfigError: no such rung."""
    names = [b for a, b in zip(words, words[1:], strict=False) if a == "--rung"]
    names += [word.partition("=")[2] for word in words if word.startswith("--rung=")]
    kind = rung_class(names[-1] if names else LadderConfig.rung)
    own = (Annotated[kind.Options, arg(name="")], field(default_factory=kind.Options))
    parsed = make_dataclass("Ladder", [("options", *own)], bases=(LadderConfig,), frozen=True)
    prog = " ".join(["golem ladder", *(f"--rung {name}" for name in names[-1:])])
    return cast(LadderConfig, tyro.cli(parsed, prog=prog, args=words, description=_description()))


def _description() -> str:
    """Return what `golem ladder --help` says: the purpose, and every rung by what can be compared on it."""
    rungs: dict[str, list[str]] = {}
    for name in RUNGS:
        kind = rung_class(name)
        purpose = inspect.cleandoc(kind.__doc__ or "").partition("\n")[0]
        rungs.setdefault(", ".join(sorted(kind().methods())), []).append(f"  {name:15s} {purpose}")
    lines = [inspect.cleandoc(LadderConfig.__doc__ or "")]
    for methods, names in rungs.items():
        lines += ["", f"Rungs that compare {methods}, or yours:", *names]
    return "\n".join(lines)


def run_ladder(config: LadderConfig) -> LadderResult:
    """Run the trials that the output folder does not hold yet, then write records, summary and report.

    Raises:
        golem.errors.ConfigError: an option says nothing this software can do; nothing was written.
        golem.errors.OutputError: the folder cannot be written, or holds trials that cannot be mixed with these.
        golem.errors.GolemError: a rung or the executor cannot go on; finished trials are kept.
        LadderInterrupted: Ctrl-C or SIGTERM.
    """
    config = config.whole()
    request, provenance = prepare(config)
    assert config.out is not None
    command = config.command()
    if config.j > 1:
        from golem.evaluation.speed.compile_ahead import compile_if_cold

        compile_if_cold()
    with _terminable(), closing(make_executor(config.executor, config.j)) as executor, RunFolder(config.out) as folder:
        held = folder.resume(request.example, provenance)
        runner = Runner(request, provenance, folder, executor, command)
        try:
            records = runner.run(held)
        except KeyboardInterrupt:
            kept = len(runner.records)
            raise LadderInterrupted(f"Stopped with {kept} trials kept; continue with: {command}") from None
        rung = request.rung
        cases = [] if rung.adaptive else [case_name(case) for case in rung.cases(lambda case: None)]
        wanted = {spec.key for spec in request.wanted({r.key: r.outcome for r in records})}
        if request.stop is not None:  # trials that ran beyond a decision depend on -j
            records = [r for r in records if r.key in wanted or r.index >= request.n or r.method not in config.method]
        records = folder.finish(records, config.method, cases)
        records = tuple(r for r in records if r.key in wanted)
        folder.state(command, provenance)
        print("Writing summary and report.", file=sys.stderr, flush=True)
        result = summed_up(config, folder.path, records, rung)
        folder.write_text("summary.json", result.summary.json() + "\n")
        try:
            from golem.evaluation.report.ladder_report import render

            report = folder.write_text("report.html", render(result))
        except MissingExtra as missing:
            return replace(result, note=f"No report was written: {missing}")
    return replace(result, report=report)


def summed_up(config: LadderConfig, out: Path, records: tuple[TrialRecord, ...], rung: Rung[Any]) -> LadderResult:
    """Return the figures of the `records` in the run folder `out`."""
    summary = summarise(records, config.method, read_costs(out), compared=not rung.adaptive)
    by_method = {method: [(r.spec, r.outcome) for r in records if r.method == method] for method in config.method}
    own = list(rung.tables(by_method))
    if config.stop == "decided":
        rule, short = config.rule(len(summary.cases)), short_names(config.method)
        rates = {
            " ".join(filter(None, (short[m], case_name(case)))): rule.values(
                [r for r in records if (r.method, r.case) == (m, case)]
            )
            for case in summary.cases
            for m in config.method
        }
        own += sequential_tables(rates, decisions(pairs_of(records, config.method, rule), rule), rule)
    return LadderResult(config, out, records, summary, tuple(own), None)


def prepare(config: LadderConfig) -> tuple[Request, Provenance]:
    """Refuse what cannot run; return what a `whole` configuration asks for, and the provenance of its records.

    Raises golem.errors.ConfigError: an option says nothing this software can do.
    """
    n, profile = config.n or 0, config.profile or ""
    for option, value, minimum in (("-n", n, 1), ("-j", config.j, 1), ("--seed", config.seed, 0)):
        if value < minimum:
            raise ConfigError(f"{option} is {value}; it must be {minimum} or more.")
    if config.limit <= 0.0:
        raise ConfigError(f"--limit is {config.limit:g}; it must be more than 0.")
    overrides, options = replaced_modules(config.use), option_values(config.options)
    rung = make_rung(RUNGS[config.rung], options)
    if not config.method:
        raise ConfigError(f"--method names no method; valid: {', '.join(sorted(rung.methods()))}.")
    for method in config.method:
        if method not in rung.methods() and ":" not in method and not method.endswith(".py"):
            raise unknown_name("method", method, rung.methods())
        if config.method.count(method) > 1:
            raise ConfigError(f"--method names '{method}' more than once.")
    check_known("profile", rung.profiles, profile)
    if rung.timed and (config.j, config.executor) != (1, "local"):
        raise ConfigError(f"Rung {rung.name} times this machine: leave out -j and --executor.")
    resolved = {method: facts(rung, method, profile, overrides, options) for method in config.method}
    example = TrialSpec(rung.name, config.method[0], profile, config.seed, 0, overrides, options)
    stop = None
    if config.stop == "decided":
        if rung.adaptive:
            raise ConfigError(f"Rung {rung.name} chooses its own cases: leave out --stop decided.")
        stop = config.rule(len(rung.cases(lambda case: None)))
    ahead = 2 * config.j if config.executor == "local" else AHEAD
    request = Request(rung, RUNGS[config.rung], config.method, n, example, config.limit, stop, ahead)
    return request, Provenance(resolved, code_files(), commit(), versions())


def find_trial(config: LadderConfig, request: Request) -> tuple[TrialSpec, TrialRecord | None]:
    """Return the trial that `--show` names, and its record if there is one. Raises ConfigError: no such trial."""
    assert config.show is not None and config.out is not None
    records = {record.key: record for record in read_records(config.out / "trials.jsonl")}
    method, _, index = config.show.rpartition(":")
    specs = [*(record.spec for record in records.values()), *request.wanted({})]
    for spec in specs:
        names = trial_name(spec), f"{spec.method}:{spec.index}"
        if config.show in names or (not method and index == str(spec.index)):
            return spec, records.get(spec.key)
    if index.isdigit() and (not method or method in config.method):
        return request.spec(method or config.method[0], int(index), request.rung.cases(lambda case: None)[0]), None
    shown = ", ".join(trial_name(spec) for spec in specs[:3])
    raise unknown_name("trial", config.show, [f"0 to {(config.n or 1) - 1}", shown, "..."])


@contextmanager
def _terminable() -> Generator[None, None, None]:
    """Let SIGTERM end the run as Ctrl-C does, with its processes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
