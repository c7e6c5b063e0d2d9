"""The contract of a skill: a goal in, feedback on the way, one result out; it can be cancelled at any await.

A skill is a coroutine, but not one of asyncio: it advances on the stack's clock. Every `await` gives the tick back,
and the runner resumes the skill at its next period, in lock-step simulation exactly as live.
"""

from __future__ import annotations

from collections.abc import Awaitable, Coroutine, Generator
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

from golem.errors import GolemError

G = TypeVar("G", contravariant=True)
C = TypeVar("C", contravariant=True)


@dataclass(frozen=True, slots=True)
class SkillResult:
    """How a skill ended.

    Attributes:
        success: whether the skill believes it reached its goal.
        stage: `"done"`, `"cancelled"`, or the stage that failed.
        slot: the slot of the module that failed, by what the robot itself can tell; None on success.
        reason: one sentence.
        timings: seconds of robot time by name, e.g. `detect_to_grasp`.
        trace: where a module failed, see `ModuleFault`; empty where none did.
    """

    success: bool
    stage: str
    slot: str | None
    reason: str
    timings: dict[str, float] = field(default_factory=dict[str, float])
    trace: str = ""


class StageFailed(GolemError):
    """A stage of a skill did not reach its goal; the skill turns it into its result.

    Attributes:
        stage, slot: as in `SkillResult`.
    """

    def __init__(self, stage: str, slot: str, reason: str) -> None:
        """Say which `stage` failed, which `slot` is held responsible, and why."""
        super().__init__(reason)
        self.stage = stage
        self.slot = slot


class SkillCancelled(BaseException):
    """Raised inside a skill at its await when it is cancelled; clean up, then let it pass."""


class Tick(Awaitable[None]):
    """Await this to give the tick back until the skill's next period."""

    def __await__(self) -> Generator[None, None, None]:
        """Suspend once."""
        yield


class Skill(Protocol, Generic[C, G]):
    """A capability with a goal, feedback and a result (a ROS 2 action at the edge).

    Attributes:
        name: how people and topics call it.
    """

    name: str

    def run(self, context: C, goal: G) -> Coroutine[None, None, SkillResult]:
        """Pursue `goal` with what `context` offers.

        Failures are results, not exceptions. `SkillCancelled` is let through after the robot was left in a state
        that is safe to stay in.
        """
        ...
