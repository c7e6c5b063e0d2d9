"""The ladder: every method of a rung on the same seeds, in parallel, resumable."""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tqdm import tqdm
from tyro.conf import arg

from golem.errors import ConfigError, GolemError, unknown_name
from golem.evaluation.base import TrialSpec, make_rung, rung_target
from golem.evaluation.harness.arguments import replaced_modules
from golem.evaluation.harness.pool import Workers
from golem.evaluation.harness.records import Provenance, RunFolder, TrialRecord, artefacts
from golem.evaluation.harness.trials import Finished, Refused, run_trial
from golem.evaluation.metrics.summary import Summary, summarise
from golem.evaluation.report.ladder_report import render
from golem.provenance import Unchanged, code_digest, commit, digest, versions


@dataclass(frozen=True)
class LadderConfig:
    """Compare methods on one rung of the capability ladder, on the same seeds.

    The output folder gets trials.jsonl (one line per trial), report.html, summary.json and pictures. An interrupted
    run continues where it stopped when the same command is given again.
    """

    rung: str = "tether"
    """Rung of the ladder."""
    method: tuple[str, ...] = ("centroid", "visual_servo")
    """Methods to compare: names, file.py:Class, or with options "{use: NAME, option: value}"; legs also as
    policy:DESCRIPTION:NETWORK."""
    n: Annotated[int, arg(aliases=("-n",))] = 30
    """Trials per method."""
    profile: str = "field"
    """Realism of sensors and world: ideal, bench or field."""
    seed: int = 0
    """Seed of the run; trial i of every method sees the same scene."""
    out: Path = Path("runs/ladder")
    """Folder for the results."""
    j: Annotated[int, arg(aliases=("-j",))] = 1
    """Processes that run trials at the same time; the records do not depend on it."""
    use: tuple[str, ...] = ()
    """Replace other modules of the stack: slot=implementation, e.g. upper_body=my_ik.py:MyIk, or with options
    "localizer={use: onnx, threshold: 0.7}"."""
    json: bool = False
    """Print the summary as a last line of JSON."""

    def command(self) -> str:
        """Return the command line that runs this configuration."""
        words = ["golem", "ladder", "--rung", self.rung, "--method", *self.method, "-n", str(self.n)]
        words += ["--profile", self.profile, "--seed", str(self.seed), "--out", str(self.out)]
        words += ["-j", str(self.j)] if self.j != 1 else []
        words += ["--use", *self.use] if self.use else []
        words += ["--json"] if self.json else []
        return shlex.join(words)


@dataclass(frozen=True, slots=True)
class LadderResult:
    """What a finished ladder found.

    Attributes:
        config: what was asked.
        records: its trials, in canonical order.
        summary: rates, comparisons, failures and times.
        report: path of the HTML report.
    """

    config: LadderConfig
    records: tuple[TrialRecord, ...]
    summary: Summary
    report: Path


class LadderInterrupted(KeyboardInterrupt):
    """The user pressed Ctrl-C; the message says how to go on. What had finished is kept."""


def run_ladder(config: LadderConfig) -> LadderResult:
    """Run the trials that the output folder does not hold yet, then write records, summary and report.

    Raises:
        golem.errors.ConfigError: an option says nothing this software can do; nothing was written.
        golem.errors.OutputError: the folder cannot be written, or holds trials that cannot be mixed with these.
        golem.errors.GolemError: a rung or a worker process cannot go on; finished trials are kept.
        LadderInterrupted: Ctrl-C.
    """
    code = Unchanged()
    overrides = replaced_modules(config.use)
    target, provenance = _check(config, overrides)
    wanted = [
        TrialSpec(config.rung, method, config.profile, config.seed, index, overrides)
        for index in range(config.n)
        for method in config.method
    ]
    with RunFolder(config.out) as folder:
        records = folder.resume(config.rung, config.profile, config.seed, overrides, provenance)
        held = {record.key for record in records}
        todo = [spec for spec in wanted if (spec.method, spec.index) not in held]
        kept = len(wanted) - len(todo)
        progress = tqdm(total=len(wanted), initial=kept, unit="trial", disable=None)
        with progress, contextlib.closing(_finished(target, todo, config.j, folder.path)) as finished:
            try:
                for spec, result in finished:
                    code.check(config.out)
                    record = provenance.record(spec, result.outcome)
                    folder.append(record, result)
                    records.append(record)
                    kept += 1
                    progress.update()
            except KeyboardInterrupt:
                raise LadderInterrupted(
                    f"Stopped with {kept} of {len(wanted)} trials kept; continue with: {config.command()}"
                ) from None
        chosen = {(spec.method, spec.index) for spec in wanted}
        records = [r for r in folder.finish(records, config.method) if r.key in chosen]
        summary = summarise(records, config.method)
        folder.write_text("summary.json", summary.json() + "\n")
        report = folder.write_text("report.html", render(config.command(), records, summary, folder.path))
    return LadderResult(config, tuple(records), summary, report)


def _check(config: LadderConfig, overrides: Mapping[str, str]) -> tuple[str, Provenance]:
    """Refuse what cannot run; return the rung's target and the provenance of its records."""
    for option, value, minimum in (("-n", config.n, 1), ("-j", config.j, 1), ("--seed", config.seed, 0)):
        if value < minimum:
            raise ConfigError(f"{option} is {value}; it must be {minimum} or more.")
    target = rung_target(config.rung)
    rung = make_rung(target)
    if not config.method:
        raise ConfigError(f"--method names no method; valid: {', '.join(sorted(rung.methods()))}.")
    for method in config.method:
        if method not in rung.methods() and ":" not in method:
            raise unknown_name("method", method, rung.methods())
        if config.method.count(method) > 1:
            raise ConfigError(f"--method names '{method}' more than once.")
    if config.profile not in rung.profiles:
        raise unknown_name("profile", config.profile, rung.profiles)
    configs = {
        method: digest({
            "rung": config.rung,
            "method": method,
            "profile": config.profile,
            "overrides": dict(overrides),
            "config": dict(rung.config(method, config.profile, overrides)),
        })
        for method in config.method
    }  # fmt: skip
    return target, Provenance(configs, code_digest(), commit(), versions())


def _finished(
    target: str, todo: Sequence[TrialSpec], jobs: int, out: Path
) -> Generator[tuple[TrialSpec, Finished], None, None]:
    """Run trials in `jobs` processes and yield them as they finish; closing it early kills what is in flight."""
    if not todo:
        return
    workers: Workers[TrialSpec, Finished | Refused] = Workers(min(jobs, len(todo)))
    with workers:
        for spec in todo:
            workers.submit(spec, run_trial, target, spec, artefacts(out, spec))
        for spec, result in workers.finished():
            yield spec, _trial(result)


def _trial(result: Finished | Refused) -> Finished:
    if isinstance(result, Finished):
        return result
    if result.trace is None:
        raise GolemError(result.message)
    raise RuntimeError(
        f"The rung itself failed, which is a fault of its code, not of a module.\n{result.trace}"
    )
