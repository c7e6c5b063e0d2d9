"""The contract between the ladder and a rung: what a trial is told, and what it reports.

A rung is one level of the capability ladder (tethered, standing, ...): a scene, a task and the methods that can
be compared on it. It is the only place that may look at the simulator's truth, to decide whether the task succeeded.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from golem.errors import unknown_name

DONE = "done"
"""The stage of a trial that lost nothing."""

RUNGS: dict[str, str] = {
    "tether": "golem.evaluation.rungs.pick_screw:TetherRung",
    "stand": "golem.evaluation.rungs.pick_screw:StandRung",
    "push": "golem.evaluation.rungs.push:PushRung",
    "push-ramp": "golem.evaluation.rungs.push_ramp:PushRampRung",
    "navigate-line": "golem.evaluation.rungs.navigate_line:NavigateLine",
}
"""Rung name -> `module:Class`; the module is imported when the rung is used."""


@dataclass(frozen=True, slots=True)
class TrialSpec:
    """One trial: everything that may influence its outcome.

    Attributes:
        rung: name of the rung.
        method: name of the method under test.
        profile: realism profile of sensors and world.
        seed: seed of the whole ladder, >= 0.
        index: number of the trial, >= 0; trials with equal (seed, index) see the same scene whatever the method.
        overrides: stack slot -> implementation that replaces the rung's own choice.
    """

    rung: str
    method: str
    profile: str
    seed: int
    index: int
    overrides: Mapping[str, str] = field(default_factory=dict[str, str])

    def rng(self, stream: str) -> np.random.Generator:
        """Return the counter-based generator of one named noise stream of this trial.

        The key is (seed, index, stream) and leaves the method out: two methods see the same draws, and a module that
        draws more from its own stream shifts nobody else's.
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
        series: name -> summary scalar of the trial, SI units, e.g. `grasp_error`.
        picture: PNG of the decisive moment, or None.

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

    def __post_init__(self) -> None:
        """Refuse an outcome that contradicts itself."""
        if self.success != (self.stage == DONE):
            raise ValueError(f"success={self.success} contradicts stage={self.stage!r}")
        if self.success and self.module is not None:
            raise ValueError(f"a success cannot be lost by {self.module!r}")
        for name, value in (*self.timings.items(), *self.series.items()):
            if not math.isfinite(value):
                raise ValueError(f"{name} is {value}; leave out what was not measured")


@runtime_checkable
class Rung(Protocol):
    """One level of the capability ladder.

    A rung is made without arguments, once per worker process, and may keep compiled models between trials; the
    outcome of a trial depends on its spec alone, never on the trials that ran before it.

    Attributes:
        name: the name it is registered under.
        profiles: realism profiles it can run with.
    """

    name: str
    profiles: tuple[str, ...]

    def methods(self) -> tuple[str, ...]:
        """Return the names of the methods that can be compared on this rung."""
        ...

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return everything but seed and index that determines a trial, as JSON-like data.

        That is the resolved stack (a user's file by its content, not its name), world and profile. Its hash goes
        into each record, and a run is only continued where the hash is the same.

        Raises:
            golem.errors.GolemError: an override names no slot or no implementation, or something this rung needs
                is absent from this machine. It is called before anything is written.
        """
        ...

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial.

        Args:
            spec: the trial.
            artefacts: folder for what should be kept beside the record; it exists only if the rung makes it.
                None keeps nothing.

        Raises:
            golem.errors.ModuleFault: a module broke its contract; the ladder records the trial as lost by it.
        """
        ...


def rung_target(name: str) -> str:
    """Return the `module:Class` of the rung called `name`.

    Raises:
        golem.errors.ConfigError: there is no such rung.
    """
    if name not in RUNGS:
        raise unknown_name("rung", name, RUNGS)
    return RUNGS[name]


def make_rung(target: str) -> Rung:
    """Import and make the rung at `target`, a `module:Class`."""
    module, _, attribute = target.partition(":")
    rung = getattr(importlib.import_module(module), attribute)()
    if not isinstance(rung, Rung):
        raise TypeError(f"{target} does not satisfy golem.evaluation.base.Rung")
    return rung
