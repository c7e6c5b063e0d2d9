"""Asking the memory where something is or was, as a skill and for skills."""

from __future__ import annotations

from dataclasses import dataclass, field

from golem.capabilities.memory.base import MemoryFault, Place, When, check_query
from golem.errors import ConfigError, GolemError
from golem.interfaces import topics
from golem.interfaces.memory_payloads import MemoryStatus
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.pose_goal import FIRST_REPORT, MARGIN


@dataclass
class RecalledPlace:
    """Where something is or was.

    Attributes:
        label: what is there.
        x, y, z: where, in the frame of the answer [m].
        score: how well it answers, 0 to 1.
        first_seen, last_seen: how long ago it was seen first and last [s].
        evidence: `seen`, `moved`, `gone` or `similar`; see `golem.capabilities.memory.base`.
    """

    label: str
    x: float
    y: float
    z: float
    score: float
    first_seen: float
    last_seen: float
    evidence: str


@dataclass
class RecalledPlaces:
    """Places, best first.

    Attributes:
        frame: frame of the places: `map`, or `odom` without a map.
        places: the places.
    """

    frame: str = "odom"
    places: list[RecalledPlace] = field(default_factory=list[RecalledPlace])


async def memory_status(context: Context) -> MemoryStatus:
    """Return what the memory tells of itself. Raises StageFailed: it does not report."""
    topic = topics.MEMORY_STATUS
    await context.until(lambda: context.bus.latest(topic) is not None, FIRST_REPORT)
    status = context.bus.latest(topic)
    if status is None:
        raise StageFailed("recall", "memory", "The memory does not report.")
    return status


async def ask(context: Context, text: str, when: When, at: float | None, limit: int) -> RecalledPlaces:
    """Return what is remembered of `text`; see `Memory.query`. A time `at` is given by how long ago it is [s].

    Raises:
        ConfigError: the question has no answer.
        StageFailed: the memory does not report.
    """
    status, memory = await memory_status(context), context.modules.memory
    now = context.t + status.epoch
    moment = None if at is None else now - at
    try:
        places = await context.think(lambda: memory.query(text, when, moment, limit), 0.0)
    except MemoryFault as refusal:
        raise ConfigError(str(refusal)) from None
    return RecalledPlaces(status.frame, [_told(place, now) for place in places])


def _told(place: Place, now: float) -> RecalledPlace:
    x, y, z = (float(v) for v in place.position)
    first, last = max(0.0, now - place.first_seen), max(0.0, now - place.last_seen)
    return RecalledPlace(place.label, x, y, z, place.score, first, last, place.evidence)


def sentence(places: RecalledPlaces) -> str:
    """Return the best place in words, and how many more there are."""
    best, more = places.places[0], len(places.places) - 1
    where = f"({best.x:.2f}, {best.y:.2f}, {best.z:.2f}) in {places.frame}"
    how = {
        "seen": f"The {best.label} is at {where}, seen {best.last_seen:.0f} s ago",
        "moved": f"The {best.label} is no longer at {where}, where it was last seen {best.last_seen:.0f} s ago",
        "gone": f"The {best.label} was at {where}, last seen {best.last_seen:.0f} s ago",
        "similar": f"Something like '{best.label}' was seen at {where}, {best.last_seen:.0f} s ago",
    }[best.evidence]
    return f"{how}; {more} more." if more else f"{how}."


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

    Stages (see `Skill`): `done`. That nothing is remembered is an answer, too.
    """

    Goal = RecallGoal
    Result = RecalledPlaces

    def timeout(self, goal: RecallGoal) -> float:
        return MARGIN

    async def run(self, context: Context, goal: RecallGoal) -> SkillResult:
        found = await ask(context, goal.text, goal.when, goal.ago, goal.limit)
        text = sentence(found) if found.places else f"Nothing is remembered of '{goal.text}'."
        context.say("done", text)
        return SkillResult(True, "done", None, text, value=found)
