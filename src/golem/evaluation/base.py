"""The contract between the ladder and a rung: what a trial is given, and what it reports.

A rung is one level of the capability ladder (tethered, standing, ...): a scene, a task and the methods that can
be compared on it. It is the only place that may look at the simulator's truth, to decide whether the task succeeded.
"""

from __future__ import annotations

import importlib
import itertools
import json
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar, cast

import numpy as np

from golem import registry
from golem.errors import check_known
from golem.evaluation.metrics.text_table import TextTable
from golem.evaluation.rung_table import PROFILES, RUNGS
from golem.options import fill

DONE = "done"
"""The stage of a trial that lost nothing."""

Key = tuple[str, str, int]
"""What tells a trial from the others of its run: method, name of the case, and index."""
Case = Mapping[str, float | str]
"""A condition under which a rung repeats its trials, e.g. `{"direction": "left", "level": 40.0}`; empty for most. All
cases of a rung have the same names, in the same order."""


def case_name(case: Case) -> str:
    """Return what people call a case, e.g. `left 40`."""
    return " ".join(value if isinstance(value, str) else f"{value:g}" for value in case.values())


@dataclass(frozen=True, slots=True)
class TrialSpec:
    """One trial: everything that may influence its outcome.

    Attributes:
        seed: seed of the whole ladder, >= 0.
        index: number of the trial, >= 0; trials with equal (seed, index) see the same scene whatever the method.
        overrides: stack slot -> implementation that replaces the rung's own choice.
        options: the rung's own options by name, JSON-like.
        case: the condition it is run under.
    """

    rung: str
    method: str
    profile: str
    seed: int
    index: int
    overrides: Mapping[str, str] = field(default_factory=dict[str, str])
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    case: Case = field(default_factory=dict[str, "float | str"])

    @property
    def key(self) -> Key:
        """What tells it from the others of its run."""
        return self.method, case_name(self.case), self.index

    def rng(self, stream: str) -> np.random.Generator:
        """Return the counter-based generator of one named noise stream of this trial.

        The key is (seed, index, stream) and leaves method and case out: two methods see the same draws, and a module
        that draws more from its own stream shifts no other module's.
        """
        sequence = np.random.SeedSequence([self.seed, self.index, *stream.encode()])
        return np.random.Generator(np.random.Philox(sequence))


@dataclass(frozen=True, slots=True)
class TrialOutcome:
    """What became of one trial.

    Attributes:
        success: whether the task was achieved, judged on the simulator's truth.
        stage: the stage that failed, or `"done"`.
        module: `"slot: implementation"` that lost the success; None on success or where none is to blame.
        detail: one sentence for the person who reads the failure.
        timings: name -> robot seconds, e.g. `detect_to_grasp`; a time that was not reached is left out.
        series: name -> summary scalar of the trial, SI units, e.g. `grasp_error`; see `metrics.yaml`.
        picture: PNG of the decisive moment, or None.
        trace: where in its code a module failed, as Python prints it; None where none raised.
        costs: name -> scalar that depends on the machine, e.g. CPU time [s]; never part of the record.

    Raises:
        ValueError: success and stage contradict each other, a success blames a module, or a number is not finite.
    """

    success: bool
    stage: str
    module: str | None = None
    detail: str = ""
    timings: Mapping[str, float] = field(default_factory=dict[str, float])
    series: Mapping[str, float] = field(default_factory=dict[str, float])
    picture: bytes | None = None
    trace: str | None = None
    costs: Mapping[str, float] = field(default_factory=dict[str, float])

    def __post_init__(self) -> None:
        if self.success != (self.stage == DONE):
            raise ValueError(f"success={self.success} contradicts stage={self.stage!r}")
        if self.success and self.module is not None:
            raise ValueError(f"a success cannot be lost by {self.module!r}")
        for name, value in (*self.timings.items(), *self.series.items(), *self.costs.items()):
            if not math.isfinite(value):
                raise ValueError(f"{name} is {value}; leave out what was not measured")


@dataclass(frozen=True, slots=True)
class NoOptions:
    """The options of a rung that has none."""


O = TypeVar("O")  # noqa: E741 - the options
Results = Callable[[Case], "Sequence[TrialOutcome] | None"]
"""Case -> the outcomes of one method's trials in the order of their indices; None until all of them are there."""
Outcomes = Mapping[str, "Sequence[tuple[TrialSpec, TrialOutcome]]"]
"""Method -> its trials and what became of them."""
Onlooker = Callable[[Any, Any], None]
"""Is shown every stack that a trial builds (`LockstepRunner`) and its twin (`MujocoRobot`), before the trial begins."""


class Rung(ABC, Generic[O]):
    """One level of the capability ladder.

    A rung is made from its options, once per worker process, and may keep compiled models between trials; the
    outcome of a trial depends on its spec alone, never on the trials that ran before it. A new rung is one file and
    one line in `rungs.yaml`; the first sentence of its docstring is what `golem ladder --help` says of it.

    Attributes:
        name: the name it is registered under.
        Options: dataclass of its own options, with defaults and docstrings; they become options of the command.
        default_methods, default_n, default_profile: what is compared where the command does not say.
        adaptive: whether the cases are the result: levels of a search, which depend on results, or variants of a stack.
            Elsewhere they are conditions under which methods are compared.
        provokes: whether it shoves or harms robots until they are lost, so that a stop may be right.
        timed: whether it measures the machine, so that nothing may run at the same time as a trial.
        slot: what its methods are, where they are modules.
        varied: word of a case -> the option that has its values, or these.
        onlooker: who is shown the stacks of its trials: a viewer, or on a ladder what films the lost ones.
    """

    name: str
    Options: ClassVar[type[Any]] = NoOptions
    profiles: tuple[str, ...] = PROFILES
    default_methods: tuple[str, ...] = ()
    default_n: int = 30
    default_profile: str = "field"
    adaptive: bool = False
    provokes: bool = False
    timed: bool = False
    slot: ClassVar[str] = ""
    varied: ClassVar[Mapping[str, str | Sequence[Any]]] = {}

    def __init__(self, options: O | None = None) -> None:
        """Take the options; None are the defaults. Raises ConfigError: one says nothing this rung can do."""
        self.options: O = self.Options() if options is None else options
        self.onlooker: Onlooker | None = None

    def methods(self) -> tuple[str, ...]:
        """Return the names of methods that can be compared: those registered for its slot, or the default ones."""
        return registry.names(self.slot) if self.slot else self.default_methods

    @abstractmethod
    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return everything but options, case, seed and index that determines a trial, as JSON-like data.

        That is the resolved stack (a user's file by its content, not its name), world and profile. Its hash goes into
        each record, and a run is only continued where the hash is the same. Raises golem.errors.GolemError: an override
        names no slot or no implementation, or something this rung needs is absent from this machine. It is called
        before anything is written.
        """

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial; a rung has this, or `run_together`, of its own.

        Args:
            artefacts: folder for what should be kept in addition to the record; it exists only if the rung makes it.
                None keeps nothing.

        Raises:
            golem.errors.ModuleFault: a module broke its contract; the ladder records the trial as lost by it.
        """
        return self.run_together([spec])[0]

    def cases(self, results: Results) -> Sequence[Case]:
        """Return the cases that one method's trials are to be run under, as far as `results` tells yet.

        Every case is run with all indices. It is asked again whenever a case is complete; what it returned before is
        returned again. An adaptive rung may add cases that follow from results. By default: all combinations of what is
        `varied`.
        """
        values = [getattr(self.options, v) if isinstance(v, str) else v for v in self.varied.values()]
        return [dict(zip(self.varied, combined, strict=True)) for combined in itertools.product(*values)]

    def together(self, spec: TrialSpec) -> Hashable:
        """Return a key that the trials have in common which are best run in one go, by `run_together`."""
        return spec.key

    def run_together(self, specs: Sequence[TrialSpec]) -> Sequence[TrialOutcome]:
        """Run trials with a common key; each outcome is the one that `run` would return, artefacts are not kept."""
        return [self.run(spec, None) for spec in specs]

    def tables(self, outcomes: Outcomes) -> Sequence[TextTable]:
        """Return tables of its own for the report, beyond rates and metrics; `outcomes` are by method."""
        return ()

    def plot(self, outcomes: Outcomes, figure: Any) -> str | None:
        """Draw a plot of its own into a figure of matplotlib, and return its title; None draws nothing."""
        return None


def rung_class(name: str) -> type[Rung[Any]]:
    """Import the rung called `name`. Raises ConfigError: there is no such rung."""
    check_known("rung", RUNGS, name)
    return _load(RUNGS[name])


def make_rung(target: str, options: Mapping[str, Any] | None = None) -> Rung[Any]:
    """Import and make the rung at `target`, a `module:Class`, with its `options`. Raises ConfigError: one is wrong."""
    kind = _load(target)
    return kind(fill(f"option of rung {kind.name}", kind.Options, options or {}))


def option_values(options: Any) -> dict[str, Any]:
    """Return the fields of an options dataclass, JSON-like."""
    return json.loads(json.dumps(asdict(options)))


def _load(target: str) -> type[Rung[Any]]:
    module, _, attribute = target.partition(":")
    kind: Any = getattr(importlib.import_module(module), attribute)
    if not (isinstance(kind, type) and issubclass(kind, Rung)):
        raise TypeError(f"{target} is no golem.evaluation.base.Rung")
    return cast("type[Rung[Any]]", kind)
