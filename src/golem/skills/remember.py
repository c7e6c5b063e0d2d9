"""Looking for things, so that the memory takes them in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from golem.errors import ConfigError
from golem.interfaces import topics
from golem.options import require
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.pose_goal import MARGIN
from golem.skills.recall import RecalledPlaces, ask, memory_status, sentence

MAX_SECONDS = 3600.0


@dataclass(frozen=True, slots=True)
class RememberGoal:
    """What to look for.

    Attributes:
        labels: kinds of things that the localizer knows, such as `screw`.
        seconds: how long to look [s].
        camera: `head`, `left_hand` or `right_hand`.
    """

    labels: tuple[str, ...]
    seconds: float = 3.0
    camera: Literal["head", "left_hand", "right_hand"] = "head"

    def __post_init__(self) -> None:
        if not self.labels or not all(label.strip() for label in self.labels):
            raise ConfigError("Name at least one kind of thing to remember, such as 'screw'.")
        require(
            "goal of remembering: ",
            ("seconds", self.seconds, 0.0 < self.seconds <= MAX_SECONDS, "a time of at most an hour"),
        )


class Remember:
    """Look for things with one camera, and remember where they are; nothing moves.

    Stages (see `Skill`): `look`, `done`. Every skill that looks has things remembered; this one does nothing else.
    """

    Goal = RememberGoal
    Result = RecalledPlaces

    def timeout(self, goal: RememberGoal) -> float:
        return goal.seconds + MARGIN

    async def run(self, context: Context, goal: RememberGoal) -> SkillResult:
        before = (await memory_status(context)).looks
        context.say("look", f"Looking for {', '.join(goal.labels)}.")
        with context.watch(goal.camera, *goal.labels):
            await context.sleep(goal.seconds)
        status = context.bus.latest(topics.MEMORY_STATUS)
        if status is None or status.looks == before:
            why = "no frame came" if status is None or not status.problem else status.problem
            raise StageFailed("look", "memory", f"Nothing was taken in within {goal.seconds:g} s: {why}")
        found = RecalledPlaces(status.frame)
        for label in goal.labels:
            found.places += (await ask(context, label, "now", None, 100)).places
        text = f"{status.looks - before} looks; " + (
            sentence(found) if found.places else f"nothing of {', '.join(goal.labels)} was found."
        )
        context.say("done", text)
        return SkillResult(True, "done", None, text, value=found)
