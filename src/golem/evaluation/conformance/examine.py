"""Runs a suite on a module."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from time import thread_time as cpu_now
from types import FrameType

from golem import registry
from golem.errors import MissingExtra, MissingSystemLibrary, ModuleFault, check_known
from golem.evaluation.conformance import base
from golem.evaluation.conformance.suite import Suite
from golem.evaluation.no_search import searching_forbidden
from golem.package_data import load_data
from golem.stack import read_choice
from golem.traces import caller

LIMIT = 120.0
"""CPU time that one promise may take [s] [own: ten times what the slowest shipped module takes]."""
PERIOD = 0.5
"""CPU time of the process between two looks [s]."""


class Endless(BaseException):
    """A promise took more CPU time than it may; the text says where. It passes `except Exception` of a module."""


@contextmanager
def cpu_limit() -> Generator[None, None, None]:
    """Raise `Endless` in what runs within once this thread has spent `LIMIT` of CPU time.

    Only the main thread can be interrupted; elsewhere there is no limit. Native code ends before it is.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    started = cpu_now()

    def look(number: int, frame: FrameType | None) -> None:
        if cpu_now() - started > LIMIT:
            place = caller(frame) if frame is not None else None
            where = f" and had not ended at {place}" if place else ""
            raise Endless(f"it took more than {LIMIT:g} s of CPU time{where}")

    before = signal.signal(signal.SIGPROF, look)
    signal.setitimer(signal.ITIMER_PROF, PERIOD, PERIOD)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


_DATA = load_data(__package__, "suites.yaml")
SUITES: dict[str, str] = _DATA["suites"]
"""Slot -> `module:Class` of its suite, imported when it is used."""
OPTIONS: dict[str, dict[str, Mapping[str, object]]] = _DATA["options"]
"""Slot -> name -> what a shipped module without default options is checked with."""
UNCHECKED: dict[str, dict[str, str]] = _DATA["unchecked"]
"""Slot -> name -> why `golem check` leaves a shipped module out where it is not asked for it."""


def suite_of(slot: str) -> Suite:
    """Return the suite of `slot`. Raises ConfigError: there is no such slot."""
    check_known("slot", SUITES, slot)
    module, _, name = SUITES[slot].partition(":")
    return getattr(import_module(module), name)()


def promises(slot: str) -> tuple[base.Check, ...]:
    """Return the checks of a slot's suite. Raises ConfigError: there is no such slot."""
    return base.checks_of(type(suite_of(slot)))


def candidate(slot: str, use: str) -> base.Candidate:
    """Return the module `use` of `slot`, ready to be made.

    Args:
        use: registered name, `file.py:Class`, `package.module:Class`, or `{use: NAME, option: value, ...}`.

    Raises:
        ConfigError: there is no such slot, name, file or class.
        ModuleFault: importing the file raised.
    """
    suite = suite_of(slot)
    choice = read_choice(slot, use)
    name = choice.use if use.startswith("{") else use
    options = choice.options or OPTIONS.get(slot, {}).get(name, {})
    registry.load(slot, name)
    return base.Candidate(slot, name, lambda: registry.create(slot, name, options, **suite.context()))


def examine(subject: base.Candidate, on_check: Callable[[base.Check], None] = lambda check: None) -> base.Report:
    """Run every check of the suite of its slot on `subject`; nothing that the module does is raised."""
    with searching_forbidden():
        return run_suite(suite_of(subject.slot), subject, on_check)


def run_suite(suite: object, subject: base.Candidate, on_check: Callable[[base.Check], None]) -> base.Report:
    """Run every check of `suite` on `subject`; see `examine`."""
    findings, closed = list[base.Finding](), ""
    for check in base.checks_of(type(suite)):
        on_check(check)
        if closed:
            finding = base.Finding(
                check.name, check.promise, base.SKIPPED, f"not asked: '{closed.replace('_', ' ')}' failed"
            )
        else:
            try:
                with cpu_limit():
                    finding = _ask(suite, check, subject)
            except (MissingExtra, MissingSystemLibrary) as lack:
                return base.Report(subject.slot, subject.use, tuple(findings), str(lack))
            except Endless as overdue:
                finding, closed = base.Finding(check.name, check.promise, base.FAILED, str(overdue)), check.name
        findings.append(finding)
        if check.gate and finding.status == base.FAILED:
            closed = check.name
    return base.Report(subject.slot, subject.use, tuple(findings))


def _ask(suite: object, check: base.Check, subject: base.Candidate) -> base.Finding:
    subject.figures = {}
    try:
        with _own_faults(subject):
            check.run(suite, subject)
    except base.Inapplicable as why:
        return base.Finding(check.name, check.promise, base.SKIPPED, str(why))
    except ModuleFault as fault:
        if isinstance(fault.__cause__, base.Inapplicable):
            return base.Finding(check.name, check.promise, base.SKIPPED, str(fault.__cause__))
        return base.Finding(check.name, check.promise, base.FAILED, fault.reason, fault.trace, subject.figures)
    return base.Finding(check.name, check.promise, base.PASSED, figures=subject.figures)


@contextmanager
def _own_faults(subject: base.Candidate) -> Iterator[None]:
    """Turn what a module raises where it is made, or hands the suite to trip over, into its fault."""
    try:
        yield
    except (ModuleFault, base.Inapplicable, MissingExtra, MissingSystemLibrary):
        raise
    except (Exception, SystemExit) as error:  # a user's module may raise anything, and return anything
        raise ModuleFault.of(subject.slot, subject.use, error) from error
