"""A batch of trials, as a worker runs it, and how it can end."""

from __future__ import annotations

import functools
import json
import resource
import tempfile
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Any

from golem.errors import GolemError, ModuleFault
from golem.evaluation.base import Rung, TrialOutcome, TrialSpec, make_rung
from golem.evaluation.episodes.last_seconds import FILM, LastSeconds
from golem.evaluation.harness.copies import CopyDied
from golem.evaluation.harness.run_folder import Finished
from golem.evaluation.no_search import searching_forbidden
from golem.provenance import changes, code_files, commit, digest, versions
from golem.runtime.contract_check import ContractCheck
from golem.runtime.safety_nodes import GateTally, tallied
from golem.skills.base import FAULT
from golem.skills.runner import SLOT, SkillRun


@dataclass(frozen=True, slots=True)
class Culprit:
    """Who had control.

    Attributes:
        module: `"slot: implementation"`; None where the thread was in no module.
        trace: the frames from the module's call on, as Python prints them; all where it was in none.
        place: file, line and function of the innermost frame.
    """

    module: str | None
    trace: str
    place: str


def culprit(frames: list[tuple[FrameType, int]]) -> Culprit:
    """Return who was in control in `frames`, each with its line, the outermost first."""
    module, start = None, 0
    for i, (frame, _) in enumerate(frames):
        owner = frame.f_locals.get("self")
        if frame.f_code is ContractCheck.call.__code__ and isinstance(owner, ContractCheck):
            module, start = f"{owner.slot}: {owner.use}", i + 1
        elif frame.f_code is SkillRun._guard.__code__ and isinstance(owner, SkillRun):
            module, start = f"{SLOT}: {owner._name}", i + 1
    stack = traceback.StackSummary.extract(iter(frames[start:] or frames))
    last = stack[-1]
    return Culprit(module, "".join(stack.format()), f"{last.filename}, line {last.lineno}, in {last.name}")


def culprit_at(frame: FrameType) -> Culprit:
    """Return who is in control of the thread whose innermost frame is `frame`."""
    return culprit(list(traceback.walk_stack(frame))[::-1])


@dataclass(frozen=True, slots=True)
class Batch:
    """Trials that are run in one go, because they share a past; mostly one.

    Attributes:
        target: `module:Class` of the rung.
        specs: the trials, at least one, of the same rung, options and profile.
        limit: own time that the batch may take, see `OwnTime` [s].
        configs: method -> hash of the configuration that the trial is meant to be of.
        code, versions: of the package where the run was started; a worker that has another refuses.
    """

    target: str
    specs: tuple[TrialSpec, ...]
    limit: float
    configs: Mapping[str, str]
    code: str
    versions: Mapping[str, str]

    def split(self) -> list[Batch]:
        """Return one batch per trial."""
        return [replace(self, specs=(spec,)) for spec in self.specs]


@dataclass(frozen=True, slots=True)
class Refused:
    """A batch that could not be judged.

    Exceptions travel as text because not every exception survives pickling.

    Attributes:
        trace: the stack trace where the fault is a programming error of the rung, else None.
    """

    message: str
    trace: str | None = None


@dataclass(frozen=True, slots=True)
class Died:
    """A batch whose process died.

    Attributes:
        how: in words, e.g. `"signal SIGSEGV"`.
        trace: where it was, as far as it could still say; None where it could not.
        again: whether it may be tried again; an executor that has tried says False.
    """

    how: str
    trace: str | None = None
    again: bool = True


@dataclass(frozen=True, slots=True)
class Overdue:
    """A batch that took longer than its limit, and was ended.

    Attributes:
        module: who had control, `"slot: implementation"`; None where that is unknown.
        place: file, line and function it was in, or empty.
        trace: the frames.
    """

    module: str | None = None
    place: str = ""
    trace: str | None = None


Ending = tuple[Finished, ...] | Refused | Died | Overdue
"""How a batch ends: with one `Finished` per trial, or as a whole."""


def facts(
    rung: Rung[Any], method: str, profile: str, overrides: Mapping[str, str], options: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the resolved configuration of a method's trials on a rung, JSON-like; see `Rung.config`."""
    return {
        "rung": rung.name,
        "method": method,
        "profile": profile,
        "overrides": dict(overrides),
        "options": dict(options),
        "config": json.loads(json.dumps(dict(rung.config(method, profile, overrides)))),
    }


def rung_of(batch: Batch) -> Rung[Any]:
    """Return the rung of a batch, the same for all of one rung and options."""
    return _rung(batch.target, json.dumps(dict(batch.specs[0].options)))


@functools.cache
def _rung(target: str, options: str) -> Rung[Any]:
    return make_rung(target, json.loads(options))


def run_batch(batch: Batch) -> tuple[Finished, ...] | Refused | Died:
    """Run the trials of a batch in this process."""
    wall, cpu = time.perf_counter(), _cpu()
    first = batch.specs[0]
    try:
        rung = rung_of(batch)
        mismatch = _mismatch(batch, rung)
        if mismatch:
            return Refused(mismatch)
        files: dict[str, bytes] = {}
        tally: GateTally | None = None
        if len(batch.specs) > 1:
            found = rung.run_together(batch.specs)
        else:
            with tempfile.TemporaryDirectory(prefix="golem-trial-") as folder:
                path = Path(folder) / "artefacts"
                with tallied() as tally:
                    found = [filmed_trial(rung, first, path)]
                files = {file.name: file.read_bytes() for file in path.glob("*")}
    except (ModuleFault, CopyDied, *LEAVING) as error:
        # `run_trial` lets none through: trials that were run together are run one by one.
        return Died(f"{type(error).__name__}: {error}")
    except GolemError as error:
        return Refused(str(error))
    except OSError as error:
        return Refused(f"Trial {first.index} cannot go on: {error}.")
    except Exception as error:
        return Refused(f"{type(error).__name__}: {error}", traceback.format_exc())
    share = 1.0 / len(batch.specs)
    wall, cpu = share * (time.perf_counter() - wall), share * (_cpu() - cpu)
    active, stops = (None, {}) if tally is None else (tally.active, tally.stops)
    return tuple(Finished(outcome, wall, cpu, files, active, stops) for outcome in found)


def _mismatch(batch: Batch, rung: Rung[Any]) -> str | None:
    """Return why this worker cannot run the batch as it is meant; None where it can."""
    found = changes("", dict(batch.versions), versions())
    if found:
        return f"A worker has other packages: {'; '.join(found)}; give it the same locks."
    if digest(code_files()) != batch.code:
        return f"A worker runs other code of golem, commit {commit()}; give it the same."
    for spec in batch.specs:
        now = digest(facts(rung, spec.method, spec.profile, spec.overrides, spec.options))
        if now != batch.configs[spec.method]:
            return f"Files of {spec.method} changed while this ran, or a worker has others; choose another --out."
    return None


def filmed_trial(rung: Rung[Any], spec: TrialSpec, artefacts: Path) -> TrialOutcome:
    """Run one trial, and keep the film of its last seconds if it is lost; see `run_trial`."""
    rung.onlooker = last = LastSeconds()
    try:
        outcome = run_trial(rung, spec, artefacts)
    finally:
        rung.onlooker = None
    film = None if outcome.success else last.film(outcome.stage, outcome.module)
    if film is not None:
        artefacts.mkdir(exist_ok=True)
        (artefacts / FILM).write_bytes(film)
    return outcome


LEAVING = (SystemExit, KeyboardInterrupt)
"""What a module raises that wants to end the process; Ctrl-C does not reach a worker."""


def run_trial(
    rung: Rung[Any], spec: TrialSpec, artefacts: Path | None = None, leaving: tuple[type[BaseException], ...] = LEAVING
) -> TrialOutcome:
    """Run one trial; a module that breaks its contract, or raises one of `leaving`, loses it."""
    try:
        with searching_forbidden():
            return rung.run(spec, artefacts)
    except ModuleFault as fault:
        return TrialOutcome(False, FAULT, f"{fault.slot}: {fault.use}", fault.reason, trace=fault.trace)
    except leaving as error:
        found = culprit(list(traceback.walk_tb(error.__traceback__)))
        last = "".join(traceback.format_exception_only(error))
        by = Culprit(found.module, f"Traceback (most recent call last):\n{found.trace}{last}", found.place)
        what = ": ".join(part for part in (type(error).__name__, str(error)) if part)
        return TrialOutcome(False, FAULT, by.module, f"{what} ({by.place})", trace=by.trace)


def _cpu() -> float:
    """Return the CPU time of this process and of its copies that have ended [s]."""
    copies = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + copies.ru_utime + copies.ru_stime
