"""The contract of a skill: a goal in, feedback on the way, one result out; it can be cancelled at any await.

A skill is a coroutine, but not one of asyncio: it advances on the stack's clock. Every `await` gives the tick back,
and the runner resumes the skill at its next period, in lock-step simulation exactly as live.
"""

from __future__ import annotations

import math
from collections.abc import Awaitable, Coroutine, Generator
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

from golem.errors import GolemError

G = TypeVar("G", contravariant=True)
C = TypeVar("C", contravariant=True)

CANCELLED = "cancelled"
"""Stage of the result of a skill that was cancelled."""
REFUSED = "refused"
"""Stage of the result of a goal that cannot be pursued: it makes no sense, or not to this robot, or not now."""
FAULT = "fault"
"""Stage of the result of a skill in which a module, or the skill itself, broke its contract."""
TIMEOUT = "timeout"
"""Stage of the result of a skill that took longer than its goal allows."""


@dataclass(frozen=True, slots=True)
class SkillResult:
    """How a skill ended.

    Attributes:
        success: whether the skill believes it reached its goal.
        stage: `"done"`, one of the stages above, or the stage of the skill that failed.
        slot: the slot of the module that failed, by what the robot itself can tell; None on success.
        reason: one sentence.
        timings: seconds of robot time by name, e.g. `detect_to_grasp`.
        value: what the skill found out, an instance of its `Result`; None for a skill without one.
        trace: where a module failed, see `ModuleFault`; None where none did.
    """

    success: bool
    stage: str
    slot: str | None
    reason: str
    timings: dict[str, float] = field(default_factory=dict[str, float])
    value: Any = None
    trace: str | None = None

    def __post_init__(self) -> None:
        expect("success of a result", self.success, bool)
        for name in ("stage", "reason") if self.slot is None else ("stage", "slot", "reason"):
            expect(f"{name} of a result", getattr(self, name), str)
        for name, seconds in self.timings.items():
            if not math.isfinite(seconds):
                raise TypeError(f"the timing '{name}' of a result is {seconds}")

    def check(self, slot: str) -> None:
        """Raise a `StageFailed`, of `slot` where the result names none, unless this is a success."""
        if not self.success:
            raise StageFailed(self.stage, self.slot or slot, self.reason)


def expect(what: str, value: object, kind: type[Any]) -> None:
    """Raise a `TypeError` unless `value`, called `what`, is a `kind`."""
    if not isinstance(value, kind):
        raise TypeError(f"the {what} is a {kind.__name__}, not a {type(value).__name__}")


class StageFailed(GolemError):
    """A stage of a skill did not reach its goal; the skill turns it, its `stage` and `slot`, into its result."""

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
        yield


class Routine(Protocol, Generic[C, G]):
    """What runs as a skill does; a skill is one that others can call by name."""

    def run(self, context: C, goal: G) -> Coroutine[None, None, SkillResult]:
        """Pursue `goal` with what `context` offers.

        Failures are results, not exceptions. `SkillCancelled` is let through after the robot was left in a state
        that is safe to stay in.

        Raises:
            ConfigError, PlanRefused: this robot cannot pursue this goal, or not now. The result is then `REFUSED`.
            StageFailed: the result is then of that stage, and the feedback says so.
        """
        ...


class Skill(Routine[C, G], Protocol[C, G]):
    """A capability with a goal, feedback and a result (a ROS 2 action at the edge).

    An instance pursues one goal. Its options are those of its constructor, as of any module. The first line of its
    docstring says to people what it does. What it found out may go into `SkillResult.value`, a dataclass of numbers,
    words, lists and further dataclasses.

    Attributes:
        Goal: dataclass of its goals. Fields are numbers, words, truth values, `Literal`s, lists and tuples of such,
            further dataclasses, or one of them `| None`; the section `Attributes:` of its docstring describes them to
            people. A goal without sense raises `ConfigError` in its `__post_init__`.
    """

    Goal: type[Any]

    def timeout(self, goal: G) -> float:
        """Return the robot time [s] after which the pursuit of `goal` is cancelled from outside."""
        ...
