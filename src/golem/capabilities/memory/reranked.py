"""Any memory, whose answers are put into order by what is known of the present: by objects, or by a model's eyes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol, get_args

import numpy as np

from golem.capabilities.memory.base import (
    Memory,
    Observation,
    Place,
    When,
    check_observation,
    check_query,
)
from golem.capabilities.memory.frame_index import FrameIndex, FrameIndexConfig
from golem.capabilities.memory.object_map import ObjectMap, ObjectMapConfig
from golem.capabilities.memory.picture_judge import PictureJudge, PictureJudgeConfig
from golem.capabilities.memory.top_down_map import TopDownMap
from golem.errors import ConfigError, unknown_name

Proposer = Literal["frame_index", "top_down_map"]
JudgeName = Literal["objects", "gemini"]
PROPOSERS, JUDGES = get_args(Proposer), get_args(JudgeName)


@dataclass(frozen=True)
class RerankedConfig:
    """What is put into order, and by what.

    Attributes:
        proposer: the memory whose answers these are: frame_index or top_down_map.
        judge: what puts them into order: objects, or gemini, which looks at the frames; that needs a key, a network and
            seconds for an answer, and goes with frame_index.
        candidates: how many of its places are looked at.
        near: distance up to which an object is at a place [m]; a frame knows only where its middle looks.
        frames: how frame_index remembers.
        objects: the memory that knows what is there.
        gemini: how the model is asked.
    """

    proposer: Proposer = "frame_index"
    judge: JudgeName = "objects"
    candidates: int = 20
    near: float = 1.2
    frames: FrameIndexConfig = field(default_factory=FrameIndexConfig)
    objects: ObjectMapConfig = field(default_factory=ObjectMapConfig)
    gemini: PictureJudgeConfig = field(default_factory=PictureJudgeConfig)

    def __post_init__(self) -> None:
        if self.proposer not in PROPOSERS:
            raise unknown_name("proposer", self.proposer, PROPOSERS)
        if self.judge not in JUDGES:
            raise unknown_name("judge", self.judge, JUDGES)
        if self.judge == "gemini" and self.proposer != "frame_index":
            raise ConfigError("The judge gemini looks at frames: it goes with the proposer frame_index.")


class PlaceJudge(Protocol):
    """Puts proposed places into order."""

    @property
    def last(self) -> float:
        """Time of the newest look [s]; -inf before the first."""
        ...

    def observe(self, observation: Observation) -> None:
        """Take a look in; see `Memory.observe`."""
        ...

    def order(
        self, text: str, when: When, at: float | None, proposed: Sequence[Place], limit: int
    ) -> list[Place]:
        """Return those of the proposed places that answer, with what is known of their times, best first."""
        ...

    def forget(self, text: str) -> int:
        """See `Memory.forget`."""
        ...

    def close(self) -> None:
        """See `Memory.close`."""
        ...


class ObjectJudge:
    """Orders places by an `ObjectMap`."""

    def __init__(self, config: RerankedConfig) -> None:
        """Open it.

        Raises:
            MemoryFault: its file cannot be used.
        """
        self._config = config
        self._objects = ObjectMap(config.objects)

    @property
    def last(self) -> float:
        """Time of the newest look [s]."""
        return self._objects.last

    def observe(self, observation: Observation) -> None:
        """See `PlaceJudge`."""
        self._objects.observe(observation)

    def order(
        self, text: str, when: When, at: float | None, proposed: Sequence[Place], limit: int
    ) -> list[Place]:
        """Return the objects that fit `when` and are at a proposed place."""
        fitting = self._objects.query(text, when, at, self._config.candidates)
        places: list[Place] = []
        for candidate in proposed:
            near = [known for known in fitting if self._near(known, candidate)]
            places += [known for known in near if all(known is not other for other in places)]
        return sorted(places, key=lambda p: (-p.score, -p.last_seen))[:limit]

    def _near(self, known: Place, proposed: Place) -> bool:
        return bool(np.linalg.norm(known.position[:2] - proposed.position[:2]) <= self._config.near)

    def forget(self, text: str) -> int:
        """See `PlaceJudge`."""
        return self._objects.forget(text)

    def close(self) -> None:
        """See `PlaceJudge`."""
        self._objects.close()


class Reranked:
    """Places of one memory in the order of another's evidence."""

    def __init__(self, config: RerankedConfig | None = None) -> None:
        """Open both.

        Raises:
            MemoryFault: the file of the objects cannot be used.
            ConfigError, MissingExtra: see `FrameIndex` and `PictureJudge`.
        """
        self._config = c = config or RerankedConfig()
        make: Callable[[], Memory] = (
            TopDownMap if c.proposer == "top_down_map" else lambda: FrameIndex(c.frames)
        )
        self._proposer = make()
        self._judge: PlaceJudge = ObjectJudge(c) if c.judge == "objects" else PictureJudge(c.gemini, c.near)
        self.last = self._judge.last

    def observe(self, observation: Observation) -> None:
        """See `Memory.observe`."""
        check_observation(observation, self.last)
        self._judge.observe(observation)
        self._proposer.observe(observation)
        self.last = self._judge.last

    def query(self, text: str, when: When = "now", at: float | None = None, limit: int = 5) -> list[Place]:
        """See `Memory.query`: places that the judge confirms, with their times.

        Raises:
            ServiceUnavailable: the judge is gemini, and it does not answer.
        """
        check_query(text, when, at, limit)
        proposed = self._proposer.query(text, "anywhere", None, self._config.candidates)
        return self._judge.order(text, when, at, proposed, limit)

    def forget(self, text: str) -> int:
        """See `Memory.forget`."""
        proposed = self._proposer.forget(text)
        return proposed if self._config.judge == "gemini" else self._judge.forget(text)

    def close(self) -> None:
        """See `Memory.close`."""
        self._proposer.close()
        self._judge.close()
