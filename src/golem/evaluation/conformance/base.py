"""What a conformance suite is made of: a module under test, small named checks, and what became of each."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from golem.errors import ModuleFault
from golem.runtime.contract_check import ContractCheck

PASSED, FAILED, SKIPPED = "passed", "failed", "skipped"
F = TypeVar("F", bound=Callable[..., None])
Figure = float | list[float]
"""A number, or how one changed over time."""


class Inapplicable(Exception):
    """A check says nothing about this module; the text says why."""


@dataclass
class Candidate:
    """The module under test.

    Attributes:
        make: returns a new instance of it.
        memo: what the checks have found out and need not find out again.
        figures: what the check that runs has measured, by name with unit; a list is a course over time.
    """

    slot: str
    use: str
    make: Callable[[], Any]
    memo: dict[str, Any] = field(default_factory=dict[str, Any])
    figures: dict[str, Figure] = field(default_factory=dict[str, "Figure"])

    @property
    def contract(self) -> ContractCheck:
        """A watcher that turns whatever goes wrong into a `ModuleFault`."""
        return ContractCheck(self.slot, self.use)

    def fault(self, reason: str) -> ModuleFault:
        """Return the fault of this module for `reason`."""
        return self.contract.fault(reason)

    def remember(self, key: str, find: Callable[[], Any]) -> Any:
        """Return what `find` returned when it was called for `key`, once."""
        if key not in self.memo:
            self.memo[key] = find()
        return self.memo[key]


@dataclass(frozen=True, slots=True)
class Check:
    """One promise of a contract.

    Attributes:
        name: in a word or two, with underscores.
        promise: the promise in one line.
        gate: whether nothing further is to be asked of a module that breaks it.
        run: asks a suite and a candidate; raises `ModuleFault` where the promise is broken, `Inapplicable` where it
            says nothing.
    """

    name: str
    promise: str
    gate: bool
    run: Callable[[Any, Candidate], None]


@dataclass(frozen=True, slots=True)
class Finding:
    """What became of one check.

    Attributes:
        status: `passed`, `failed` or `skipped`.
        reason: why it failed or was skipped, in one line.
        trace: see `ModuleFault`.
        figures: what was measured, by name with unit.
    """

    check: str
    promise: str
    status: str
    reason: str = ""
    trace: str | None = None
    figures: Mapping[str, Figure] = field(default_factory=dict[str, "Figure"])


@dataclass(frozen=True, slots=True)
class Report:
    """What became of one module.

    Attributes:
        findings: one per check, in the order of the suite.
        lacks: what this machine lacks to run the module; None where it lacks nothing.
    """

    slot: str
    use: str
    findings: tuple[Finding, ...]
    lacks: str | None = None

    @property
    def failed(self) -> tuple[Finding, ...]:
        """The promises that the module breaks."""
        return tuple(finding for finding in self.findings if finding.status == FAILED)

    @property
    def passed(self) -> bool:
        """Whether the module was checked and breaks none."""
        return self.lacks is None and not self.failed


def check(function: F, gate: bool = False) -> F:
    """Make a method of a suite one of its checks; the docstring is the promise."""
    promise = (inspect.getdoc(function) or "").partition("\n")[0]
    setattr(function, "_check", Check(function.__name__, promise, gate, function))  # noqa: B010
    return function


def gate(function: F) -> F:
    """Make a method of a suite a check without which the others mean nothing."""
    return check(function, gate=True)


def checks_of(suite: type[Any]) -> tuple[Check, ...]:
    """Return the checks of a class of suites, those of its base first, each as the class last defined it."""
    found: dict[str, Check] = {}
    for owner in reversed(suite.__mro__):
        members: Mapping[str, Any] = vars(owner)
        for name, member in members.items():
            if name in found or hasattr(member, "_check"):
                found[name] = getattr(member, "_check", None) or found[name]
    return tuple(found.values())
