"""Resumes the running skill once per period, on the stack's clock."""

from __future__ import annotations

from collections.abc import Callable, Coroutine

from golem.capabilities.planning.base import PlanRefused
from golem.errors import ConfigError, MissingExtra, MissingSystemLibrary, ModuleFault
from golem.skills.base import CANCELLED, FAULT, REFUSED, SkillCancelled, SkillResult, StageFailed

LACKS = (MissingExtra, MissingSystemLibrary)
"""What this machine may lack, which is no module's fault."""
SLOT = "skill"
"""Who is held responsible for what a skill raises itself."""


class SkillRun:
    """One execution of a skill. Whatever the skill does ends in a result: nothing is raised here.

    Attributes:
        result: how it ended; None while it runs.
        cancelled: whether it was cancelled, however it then ended.
        failure: what it raised of a stage that failed.
        error: what it raised that no skill should.
    """

    def __init__(self, name: str, coroutine: Coroutine[None, None, SkillResult]) -> None:
        """Take over the skill called `name`, whose `run` was called but has not started yet."""
        self._name = name
        self._coroutine = coroutine
        self.result: SkillResult | None = None
        self.cancelled = False
        self.failure: StageFailed | None = None
        self.error: BaseException | None = None
        if not isinstance(coroutine, Coroutine):
            self.result = self._fault("its 'run' is not an 'async def'")

    def step(self) -> None:
        """Resume the skill until its next await."""
        if self.result is None:
            self._guard(lambda: self._coroutine.send(None))

    def cancel(self) -> None:
        """Raise `SkillCancelled` inside the skill; it may still await to leave the robot safe."""
        if self.result is None:
            self.cancelled = True
            self._guard(lambda: self._coroutine.throw(SkillCancelled()))

    def end(self, result: SkillResult) -> None:
        """End the skill with `result` now; the skill learns it as a cancellation that leaves it no further tick."""
        if self.result is None:
            self.cancel()
            self.close()
            self.result = result

    def fail(self, slot: str, reason: str, trace: str | None = None) -> None:
        """End the skill because the module in `slot` broke its contract; see `ModuleFault`."""
        self.end(SkillResult(False, FAULT, slot, reason, trace=trace))

    def close(self) -> None:
        """Let the skill, if it has not ended, clean up without a further tick."""
        if self.result is None:
            self._guard(self._coroutine.close)

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
            self.result = SkillResult(False, CANCELLED, None, "The skill was cancelled.")
        except StageFailed as failure:
            self.failure = failure
            self.result = SkillResult(False, failure.stage, failure.slot, str(failure))
        except (ConfigError, PlanRefused) as refusal:
            self.result = SkillResult(False, REFUSED, None, str(refusal))
        except ModuleFault as fault:
            self.result = _failed(fault)
        except LACKS as lack:
            self.error = lack
            self.result = SkillResult(False, FAULT, SLOT, str(lack))
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a user's skill may raise anything, even SystemExit
            self.error = error
            self.result = _failed(ModuleFault.of(SLOT, self._name, error))

    def _fault(self, reason: str) -> SkillResult:
        return _failed(ModuleFault(SLOT, self._name, reason))


def _failed(fault: ModuleFault) -> SkillResult:
    return SkillResult(False, FAULT, fault.slot, str(fault), trace=fault.trace)
