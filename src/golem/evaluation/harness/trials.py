"""One trial, as a worker process runs it."""

from __future__ import annotations

import functools
import multiprocessing
import os
import threading
import time
import traceback
from dataclasses import dataclass
from multiprocessing.connection import wait
from pathlib import Path

from golem.errors import GolemError, ModuleFault
from golem.evaluation.base import Rung, TrialOutcome, TrialSpec, make_rung
from golem.skills.base import FAULT

SINGLE_THREAD = {
    name: "1"
    for name in (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
    )
}
"""Environment of a worker: one thread each, so that `-j` alone sets the load and sums are in one order."""


@dataclass(frozen=True, slots=True)
class Finished:
    """A trial that came to an outcome, with its cost in wall and CPU seconds of this machine."""

    outcome: TrialOutcome
    wall: float
    cpu: float


@dataclass(frozen=True, slots=True)
class Refused:
    """A trial that could not be judged.

    Exceptions travel as text because not every exception survives pickling.

    Attributes:
        message: one sentence for the user.
        trace: the stack trace where the fault is a programming error of the rung, else None.
    """

    message: str
    trace: str | None = None


def start_worker() -> None:
    """Prepare a worker process: the death of its parent ends it."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


def _follow(sentinel: int) -> None:
    # A pool worker holds both ends of its task queue, so it would wait for ever for a parent that was killed.
    wait([sentinel])
    os._exit(1)


@functools.cache
def _rung(target: str) -> Rung:
    return make_rung(target)


def run_trial(target: str, spec: TrialSpec, artefacts: Path) -> Finished | Refused:
    """Run one trial of the rung at `target` (`module:Class`)."""
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        outcome = _rung(target).run(spec, artefacts)
    except ModuleFault as fault:
        outcome = TrialOutcome(False, FAULT, f"{fault.slot}: {fault.use}", fault.reason)
    except GolemError as error:
        return Refused(str(error))
    except OSError as error:
        return Refused(
            f"Cannot write what trial {spec.index} keeps to {artefacts}: {error.strerror or error}."
        )
    except Exception as error:
        return Refused(f"{type(error).__name__}: {error}", traceback.format_exc())
    return Finished(outcome, time.perf_counter() - wall, time.process_time() - cpu)
