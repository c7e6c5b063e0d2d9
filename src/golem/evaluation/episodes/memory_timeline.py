"""What a memory believed of each object, look after look, and whether it would have told where the object is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from golem.capabilities.memory.base import Memory, Place
from golem.evaluation.episodes.relocation import Relocation, Thing

HIT = 1.0
"""Distance up to which an answer is right [m]: the same counter, the next ones being 2.4 m away [own]."""
Belief = Literal["", "there", "gone"]
"""Of a place: nothing is remembered of it, something is taken to be there, something was there once."""


@dataclass(slots=True)
class ObjectTimeline:
    """One object at one place.

    Attributes:
        name: for a person.
        thing: its kind and place.
        present: whether it stands there, at each look.
        beliefs: one after each look.
        told: whether "where is it now?" was answered rightly after each look; None where it does not stand there, or no
            look had shown it so far.
        seen: the looks in which the localizer found one of its kind there.
    """

    name: str
    thing: Thing
    present: tuple[bool, ...]
    beliefs: list[Belief] = field(default_factory=list["Belief"])
    told: list[bool | None] = field(default_factory=list["bool | None"])
    seen: list[int] = field(default_factory=list[int])


def hits(place: Place, thing: Thing) -> bool:
    """Return whether an answer names the place of a thing."""
    return bool(np.linalg.norm(place.position[:2] - thing.position[:2]) <= HIT)


def timeline(memory: Memory, episode: Relocation) -> list[ObjectTimeline]:
    """Show an episode to a new memory, which is asked after each look, and return a row per object."""
    old, always = episode.at_old, (True,) * len(episode.observations)
    rows = [
        ObjectTimeline(f"{episode.target}, old place", episode.before[0], old),
        ObjectTimeline(f"{episode.target}, new place", episode.after[0], tuple(not there for there in old)),
        *(
            ObjectTimeline(f"{thing.kind}{', another' if thing.kind == episode.target else ''}", thing, always)
            for thing in episode.before[1:]
        ),
    ]
    for k, look in enumerate(episode.observations):
        memory.observe(look)
        for row in rows:
            kind = row.thing.kind
            found = (f.position for f in look.objects if f.label == kind)
            if any(np.linalg.norm(at[:2] - row.thing.position[:2]) <= HIT for at in found):
                row.seen.append(k)
            known = [p for p in memory.query(kind, "anywhere", None, 20) if hits(p, row.thing)]
            there = any(p.evidence in ("seen", "similar") for p in known)
            row.beliefs.append("there" if there else "gone" if known else "")
            now = memory.query(kind, "now", None, 1) if row.present[k] and row.seen else None
            row.told.append(None if now is None else _right(now, row.thing))
    return rows


def _right(now: Sequence[Place], thing: Thing) -> bool:
    """Return whether the first place of an answer, which is not told as moved, is that of the thing."""
    return bool(now) and now[0].evidence != "moved" and hits(now[0], thing)
