"""Resumes the running skill once per period, on the stack's clock."""

from __future__ import annotations

from collections.abc import Callable, Coroutine

from golem.errors import MissingExtra, MissingSystemLibrary, ModuleFault
from golem.skills.base import SkillCancelled, SkillResult, StageFailed

FAULT = "fault"
"""Stage of the result of a skill in which a module, or the skill itself, broke its contract."""
SLOT = "skill"
"""Who is held responsible for what a skill raises itself."""


class SkillRun:
    """One execution of a skill.

    Attributes:
        result: how it ended; None while it runs.
    """

    def __init__(self, name: str, coroutine: Coroutine[None, None, SkillResult]) -> None:
        """Take over the skill called `name`, whose `run` was called but has not started yet."""
        self._name = name
        self._coroutine = coroutine
        self.result: SkillResult | None = None
        if not isinstance(coroutine, Coroutine):
            self.result = self._fault("its 'run' is not an 'async def'")

    def step(self) -> None:
        """Resume the skill until its next await."""
        if self.result is None:
            self._guard(lambda: self._coroutine.send(None))

    def cancel(self) -> None:
        """Raise `SkillCancelled` inside the skill; it may still await to leave the robot safe."""
        if self.result is None:
            self._guard(lambda: self._coroutine.throw(SkillCancelled()))

    def fail(self, slot: str, reason: str, trace: str = "") -> None:
        """End the skill because the module in `slot` broke its contract; the skill learns it as a cancellation."""
        if self.result is None:
            self._guard(lambda: self._coroutine.throw(SkillCancelled()))
            self._coroutine.close()
            self.result = SkillResult(False, FAULT, slot, reason, trace=trace)

    def _guard(self, resume: Callable[[], object]) -> None:
        """Resume the skill; whatever ends it becomes its result."""
        try:
            resume()
        except StopIteration as end:
            if isinstance(end.value, SkillResult):
                self.result = end.value
            else:
                self.result = self._fault(f"it returned {type(end.value).__name__}, not SkillResult")
        except SkillCancelled:
            self.result = SkillResult(False, "cancelled", None, "The skill was cancelled.")
        except StageFailed as failure:
            self.result = SkillResult(False, failure.stage, failure.slot, str(failure))
        except ModuleFault as fault:
            self.result = _failed(fault)
        except (MissingExtra, MissingSystemLibrary):
            raise
        except (Exception, SystemExit) as error:  # a user's skill may raise anything
            self.result = _failed(ModuleFault.of(SLOT, self._name, error))

    def _fault(self, reason: str) -> SkillResult:
        return _failed(ModuleFault(SLOT, self._name, reason))


def _failed(fault: ModuleFault) -> SkillResult:
    return SkillResult(False, FAULT, fault.slot, str(fault), trace=fault.trace)
