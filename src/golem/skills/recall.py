"""Asking the memory where something is or was."""

from __future__ import annotations

from dataclasses import dataclass

from golem.capabilities.memory.base import When, check_query
from golem.errors import ConfigError, GolemError
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.pose_goal import MARGIN
from golem.skills.recalled import RecalledPlaces, ask, sentence


@dataclass(frozen=True, slots=True)
class RecallGoal:
    """A question.

    Attributes:
        text: words for one kind of thing.
        when: `now`, `at` (where it was at a time), `history` (where it was before) or `anywhere`.
        ago: how long ago the time is that `at` asks for [s].
        limit: most places.
    """

    text: str
    when: When = "now"
    ago: float = 0.0
    limit: int = 5

    def __post_init__(self) -> None:
        try:
            check_query(self.text, self.when, self.ago, self.limit)
        except GolemError as refusal:
            raise ConfigError(str(refusal)) from None


class Recall:
    """Say where something is or was, by what the robot remembers; nothing moves.

    Stages: `done`. That nothing is remembered is an answer, too.
    """

    Goal = RecallGoal
    Result = RecalledPlaces

    def timeout(self, goal: RecallGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return MARGIN

    async def run(self, context: Context, goal: RecallGoal) -> SkillResult:
        """Ask; see `Skill`."""
        try:
            found = await ask(context, goal.text, goal.when, goal.ago, goal.limit)
        except StageFailed as failure:
            return SkillResult(False, failure.stage, failure.slot, str(failure))
        text = sentence(found) if found.places else f"Nothing is remembered of '{goal.text}'."
        context.say("done", text)
        return SkillResult(True, "done", None, text, value=found)
