"""The contract of a memory: posed RGB-D frames and the objects in them in, places for words and times out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol, get_args, runtime_checkable

import numpy as np

from golem.errors import ConfigError, GolemError, unknown_name
from golem.types import Array, LocalizedObject, RgbdImage

When = Literal["now", "at", "history", "anywhere"]
"""now: where it is. at: where it was at a time. history: where it was before. anywhere: all of these."""
WHENS: tuple[When, ...] = get_args(When)
Evidence = Literal["seen", "moved", "gone", "similar"]
"""seen: nothing speaks against it. moved: it is no longer there, and where it is now is not known. gone: it was there
once. similar: the method compares looks, and says nothing about the present."""
EVIDENCES: tuple[Evidence, ...] = get_args(Evidence)
MAX_WORDS = 500
"""Longest query [characters]."""


class MemoryFault(GolemError):
    """An observation or a query that a memory cannot take, or a file that it cannot use."""


@dataclass(frozen=True, slots=True)
class Observation:
    """One look.

    Attributes:
        frame: the exposure; its pose is in a frame that stays, such as map.
        objects: what a localizer found in it, positions in the frame of its pose.
        labels: what the localizer was asked for: the absence of others says nothing.
        pose_sigma: standard deviation of the frame's position [m].
    """

    frame: RgbdImage
    objects: Sequence[LocalizedObject]
    labels: Sequence[str]
    pose_sigma: float = 0.02


@dataclass(frozen=True, slots=True)
class Place:
    """Where something is or was.

    Attributes:
        label: what is there, in the memory's words.
        position: (3,) in the frame of the observations [m].
        score: how well it answers, 0 to 1; only comparable within one answer.
        first_seen, last_seen: times of the looks that showed it [s].
        evidence: what speaks for it.
        facts: more numbers of the method, by name.
    """

    label: str
    position: Array
    score: float
    first_seen: float
    last_seen: float
    evidence: Evidence
    facts: Mapping[str, float] = field(default_factory=dict[str, float])


@runtime_checkable
class Memory(Protocol):
    """Remembers where things are and were.

    A memory is passive: it runs nothing between calls. Its clock is the observations': it must not start again as
    long as the memory lives (live: Unix time).
    """

    @property
    def last(self) -> float:
        """Time of the newest look [s]; -inf before the first. A memory with a file goes on from it."""
        ...

    def observe(self, observation: Observation) -> None:
        """Take a look in. What was observed is kept when this returns.

        Raises MemoryFault: the look is older than the last one, its pose or an object is not finite, or it cannot be
        kept. The memory is as it was.
        """

    def query(self, text: str, when: When = "now", at: float | None = None, limit: int = 5) -> list[Place]:
        """Return the places that answer best, best first; none where nothing is remembered of it.

        Args:
            text: words for one kind of thing.
            when: see `When`.
            at: the time that `when="at"` asks for [s].
            limit: most places.

        Raises:
            MemoryFault: see `check_query`.
        """
        ...

    def forget(self, text: str) -> int:
        """Forget all places of what `text` names, and return how many these were."""
        ...

    def close(self) -> None:
        """Let go of files; nothing is asked or observed afterwards."""


@runtime_checkable
class HasPlaces(Protocol):
    """A memory that can be shown whole."""

    def places(self, limit: int) -> list[Place]:
        """Return what is remembered, gone ones included, the one seen last first; at most `limit`."""
        ...


def apart(places: Iterable[Place], spread: float, limit: int) -> list[Place]:
    """Return the first `limit` places that are farther than `spread` [m] from those before them."""
    kept: list[Place] = []
    for place in places:
        if len(kept) == limit:
            break
        if all(np.linalg.norm(place.position - other.position) > spread for other in kept):
            kept.append(place)
    return kept


def check_observation(observation: Observation, last: float) -> None:
    """Refuse a look that no memory can take after one of time `last` [s]. Raises MemoryFault: see `Memory.observe`."""
    frame = observation.frame
    if not np.isfinite(frame.t):
        raise MemoryFault("The time of an observation is not finite.")
    if frame.t < last:
        raise MemoryFault(f"An observation of {frame.t:.3f} s is older than the last one, of {last:.3f} s.")
    if not np.isfinite(frame.T_odom_optical).all():
        raise MemoryFault("The pose of an observation is not finite.")
    if not (np.isfinite(observation.pose_sigma) and observation.pose_sigma >= 0.0):
        raise MemoryFault(f"The standard deviation of a pose is at least 0 m, not {observation.pose_sigma}.")
    for found in observation.objects:
        if not np.isfinite(found.position).all():
            raise MemoryFault(f"The position of a {found.label} is not finite.")


def check_query(text: str, when: str, at: float | None, limit: int) -> None:
    """Refuse a question that has no answer.

    Raises:
        MemoryFault: the text is empty or longer than `MAX_WORDS`, a time is wanted and not given or not finite, or no
            place is wanted.
        ConfigError: `when` is none of `WHENS`.
    """
    if not text.strip():
        raise MemoryFault("The query is empty; name a kind of thing, such as 'mug'.")
    if len(text) > MAX_WORDS:
        raise MemoryFault(f"The query has {len(text)} characters; at most {MAX_WORDS} are read.")
    if when not in WHENS:
        raise unknown_name("time", when, WHENS)
    if when == "at" and (at is None or not np.isfinite(at)):
        raise MemoryFault("A query with when='at' needs a finite time `at` [s].")
    if limit < 1:
        raise ConfigError(f"A query returns at least one place, not {limit}.")
