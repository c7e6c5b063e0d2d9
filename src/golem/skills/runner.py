"""Resumes the running skill once per period, on the stack's clock."""

from __future__ import annotations

from collections.abc import Coroutine

from golem.errors import ModuleFault
from golem.skills.base import SkillCancelled, SkillResult


class SkillRun:
    """One execution of a skill.

    Attributes:
        result: how it ended; None while it runs.
    """

    def __init__(self, coroutine: Coroutine[None, None, SkillResult]) -> None:
        """Take over a skill that was called but not yet started."""
        self._coroutine = coroutine
        self.result: SkillResult | None = None

    def step(self) -> None:
        """Resume the skill until its next await."""
        if self.result is None:
            self._guard(lambda: self._coroutine.send(None))

    def cancel(self) -> None:
        """Raise `SkillCancelled` inside the skill; it may still await to leave the robot safe."""
        if self.result is None:
            self._guard(lambda: self._coroutine.throw(SkillCancelled()))

    def _guard(self, resume: object) -> None:
        assert callable(resume)
        try:
            resume()
        except StopIteration as end:
            self.result = end.value
        except SkillCancelled:
            self.result = SkillResult(False, "cancelled", None, "The skill was cancelled.")
        except ModuleFault as fault:
            self.result = SkillResult(False, "fault", fault.slot, str(fault))
