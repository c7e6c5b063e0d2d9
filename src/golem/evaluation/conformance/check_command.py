"""`golem check [SLOT [USE]]`: runs the conformance suites and prints what they found."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from golem import registry
from golem.errors import GolemError
from golem.evaluation.conformance.base import FAILED, PASSED, Check, Finding, Report
from golem.evaluation.conformance.examine import SUITES, UNCHECKED, candidate, examine, suite_of
from golem.output_file import write_file

_MARKS = {PASSED: ("✓", "green"), FAILED: ("✗", "red")}


@dataclass(frozen=True)
class CheckConfig:
    """Check modules against the contracts of their slots.

    Exit code 0: all promises are kept. 1: one is broken. 2: the module cannot be found, or this machine lacks what it
    needs.
    """

    slot: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="[SLOT]", help_behavior_hint="")] = ""
    """Which slot; default: all."""
    use: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="[USE]", help_behavior_hint="")] = ""
    """Module: a name, file.py:Class, package.module:Class or "{use: NAME, option: value}"; default: all shipped."""
    json: bool = False
    """Print JSON instead of the report."""
    save: Path | None = None
    """Keep the JSON in this file, too."""


def run_check(config: CheckConfig) -> bool:
    """Check what `config` names and print the report; return whether all promises are kept.

    Raises:
        ConfigError: there is no such slot or module.
        GolemError: this machine lacks what the module needs.
        OutputError: the JSON cannot be kept.
    """
    if config.slot:
        suite_of(config.slot)
    console = Console(stderr=config.json)
    reports: list[Report] = []
    for slot, use in _wanted(config):
        subject = candidate(slot, use)
        with _shown(console, f"{slot}: {use}") as show_promise, _quiet():
            report = examine(subject, show_promise)
        if report.lacks is not None and config.use:
            raise GolemError(report.lacks)
        reports.append(report)
        if not config.json:
            _print(console, report, whole=bool(config.use))
    text = json.dumps([asdict(one) | {"passed": one.passed} for one in reports], indent=2)
    if config.json:
        print(text)
    if config.save is not None:
        write_file(config.save, text + "\n")
    return all(report.passed or report.lacks is not None for report in reports)


@contextmanager
def _shown(console: Console, module: str) -> Iterator[Callable[[Check], None]]:
    """Show which promise is asked, and since when; yields what is told it. Raises KeyboardInterrupt: says where."""
    columns = (SpinnerColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
    asked = "is made ready"
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(module)

        def show_promise(check: Check) -> None:
            nonlocal asked
            asked = check.name.replace("_", " ")
            progress.reset(task, description=f"{module}: {asked}")

        try:
            yield show_promise
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"interrupted while {module} was asked: {asked}") from None


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep off the console what libraries log of inputs that are meant to be strange."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)


def _wanted(config: CheckConfig) -> list[tuple[str, str]]:
    if config.use:
        return [(config.slot, config.use)]
    slots = [config.slot] if config.slot else list(SUITES)
    return [(slot, use) for slot in slots for use in registry.names(slot) if use not in UNCHECKED.get(slot, ())]


def _print(console: Console, report: Report, whole: bool) -> None:
    """Print the findings; of several modules only what is wrong."""
    heading = Text(f"{report.slot}: {report.use}", style="bold")
    passed = sum(finding.status == PASSED for finding in report.findings)
    if report.lacks is not None:
        heading.append(f"  not checked: {report.lacks}", style="yellow")
    elif report.failed:
        heading.append(f"  {len(report.failed)} of {passed + len(report.failed)} promises broken", style="red")
    else:
        heading.append(f"  keeps all {passed} promises", style="green")
    console.print(heading, soft_wrap=True)
    shown = [finding for finding in report.findings if whole or finding.status == FAILED]
    if shown:
        console.print(_table(shown))
    for trace in dict.fromkeys(finding.trace for finding in report.failed if finding.trace):
        console.print(Text(trace), soft_wrap=True)


def _table(findings: list[Finding]) -> Table:
    table = Table(show_header=False, box=None, padding=(0, 1))
    for finding in findings:
        mark, style = _MARKS.get(finding.status, ("-", "dim"))
        said = finding.promise if finding.status == PASSED else finding.reason
        numbers = [f"{name} {value:.3g}" for name, value in finding.figures.items() if isinstance(value, float)]
        said += f" {'; '.join(numbers)}." if numbers else ""
        table.add_row(Text(mark, style=style), Text(finding.check.replace("_", " ")), Text(said, style=style))
    return table
