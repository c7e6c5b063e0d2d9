"""Any memory, whose answers are put into order by what a memory of objects knows of the present."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from golem.capabilities.memory.base import Memory, Observation, Place, When, check_query
from golem.capabilities.memory.frame_index import FrameIndex
from golem.capabilities.memory.object_map import ObjectMap, ObjectMapConfig
from golem.capabilities.memory.top_down_map import TopDownMap
from golem.errors import unknown_name

Proposer = Literal["frame_index", "top_down_map"]
PROPOSERS: dict[str, Callable[[], Memory]] = {"frame_index": FrameIndex, "top_down_map": TopDownMap}
assert set(PROPOSERS) == set(get_args(Proposer))


@dataclass(frozen=True, slots=True)
class RerankedConfig:
    """What is put into order, and by what.

    Attributes:
        proposer: the memory whose answers these are: frame_index or top_down_map.
        candidates: how many of its places are looked at.
        near: distance up to which an object is at a place [m]; a frame knows only where its middle looks.
        objects: the memory that knows what is there.
    """

    proposer: Proposer = "frame_index"
    candidates: int = 20
    near: float = 1.2
    objects: ObjectMapConfig = field(default_factory=ObjectMapConfig)

    def __post_init__(self) -> None:
        """Refuse what has no meaning.

        Raises:
            ConfigError: there is no such memory.
        """
        if self.proposer not in PROPOSERS:
            raise unknown_name("proposer", self.proposer, PROPOSERS)


class Reranked:
    """Places of one memory in the order of another's evidence."""

    def __init__(self, config: RerankedConfig | None = None) -> None:
        """Open both.

        Raises:
            MemoryFault: the file of the objects cannot be used.
        """
        self._config = config or RerankedConfig()
        self._proposer = PROPOSERS[self._config.proposer]()
        self._objects = ObjectMap(self._config.objects)
        self.last = self._objects.last

    def observe(self, observation: Observation) -> None:
        """See `Memory.observe`."""
        self._objects.observe(observation)
        self._proposer.observe(observation)
        self.last = self._objects.last

    def query(self, text: str, when: When = "now", at: float | None = None, limit: int = 5) -> list[Place]:
        """See `Memory.query`: places with an object that fits `when` first, and with its place and times."""
        check_query(text, when, at, limit)
        fitting = self._objects.query(text, when, at, self._config.candidates)
        places: list[Place] = []
        for proposed in self._proposer.query(text, "anywhere", None, self._config.candidates):
            near = [known for known in fitting if self._near(known, proposed)]
            places += [known for known in near if all(known is not other for other in places)]
        return sorted(places, key=lambda p: (-p.score, -p.last_seen))[:limit]

    def _near(self, known: Place, proposed: Place) -> bool:
        return bool(np.linalg.norm(known.position[:2] - proposed.position[:2]) <= self._config.near)

    def forget(self, text: str) -> int:
        """See `Memory.forget`."""
        self._proposer.forget(text)
        return self._objects.forget(text)

    def close(self) -> None:
        """See `Memory.close`."""
        self._proposer.close()
        self._objects.close()
