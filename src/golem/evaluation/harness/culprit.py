"""Which module a thread was in, read from its frames: for what no module's watcher catches or sees an end of."""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from types import FrameType

from golem.runtime.contract_check import ContractCheck
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


def culprit_of(error: BaseException) -> Culprit:
    """Return who raised `error`, which was caught."""
    found = culprit(list(traceback.walk_tb(error.__traceback__)))
    last = "".join(traceback.format_exception_only(error))
    return Culprit(found.module, f"Traceback (most recent call last):\n{found.trace}{last}", found.place)


def culprit_at(frame: FrameType) -> Culprit:
    """Return who is in control of the thread whose innermost frame is `frame`."""
    return culprit(list(traceback.walk_stack(frame))[::-1])
