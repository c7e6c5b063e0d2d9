"""Any memory, whose answers are put into order by what is known of the present: by objects, or by a model's eyes.

A vision-language model is shown two pictures of each place that is proposed, then and now. After the re-ranking of the
GOLEM paper, which gives no details of it: the model says of every look whether the thing is in it, and what is no
longer seen where it was is history.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, cast, get_args

import cv2
import numpy as np

from golem.capabilities.memory.base import Evidence, Memory, Observation, Place, When, check_observation, check_query
from golem.capabilities.memory.frame_index import FrameIndex, FrameIndexConfig, looked_at
from golem.capabilities.memory.object_map import ObjectMap, ObjectMapConfig
from golem.capabilities.memory.top_down_map import TopDownMap
from golem.capabilities.perception import gemini_service
from golem.errors import ConfigError, unknown_name
from golem.types import Array

SCORE = 0.9
"""Of what the model says it sees."""


@dataclass(frozen=True)
class PictureJudgeConfig(gemini_service.GeminiServiceConfig):
    """Options of `PictureJudge`; see `GeminiServiceConfig`, and these.

    Attributes:
        pictures: looks that are kept; the oldest are forgotten first.
        width: of a picture that is kept and sent [px].
        places: of which the model is asked at most, each with two pictures.
    """

    pictures: int = 500
    width: int = 320
    places: int = 6

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.pictures >= 1 and 32 <= self.width <= 4096 and 1 <= self.places <= 50):
            raise ConfigError("Of gemini, pictures is at least 1, width from 32 to 4096, and places from 1 to 50.")


@dataclass(frozen=True, slots=True)
class _Picture:
    """A look that was kept: its time [s], the (3,) point it looks at [m], and its image as JPEG."""

    t: float
    at: Array
    jpeg: bytes


class PictureJudge:
    """Has Gemini look at the pictures of places."""

    def __init__(self, config: PictureJudgeConfig, near: float, sleep: Callable[[float], None] = time.sleep) -> None:
        """Take the key from the environment; looks within `near` [m] are of one place. Raises ConfigError: no key."""
        self._config, self._near = config, near
        self._service = gemini_service.GeminiService(config, "Re-ranking by gemini", "choose the judge objects", sleep)
        self._pictures: deque[_Picture] = deque(maxlen=config.pictures)
        self.last = -math.inf

    def observe(self, observation: Observation) -> None:
        """Keep a look."""
        frame = observation.frame
        height, width = frame.rgb.shape[:2]
        size = self._config.width, max(1, round(height * self._config.width / width))
        small = cv2.resize(frame.rgb, size, interpolation=cv2.INTER_AREA)
        jpeg = gemini_service.to_jpeg(np.asarray(small, np.uint8))
        self._pictures.append(_Picture(frame.t, looked_at(observation), jpeg))
        self.last = frame.t

    def order(self, text: str, when: When, at: float | None, proposed: Sequence[Place], limit: int) -> list[Place]:
        """Return those of the places that answer by what the model sees. Raises as `GeminiService.ask` does."""
        pairs: list[tuple[_Picture, _Picture]] = []
        for place in proposed:
            then = next((p for p in self._pictures if p.t == place.last_seen), None)
            if then is not None and (at is None or when != "at" or then.t <= at):
                now = next(p for p in reversed(self._pictures) if self._same(p, then))
                pairs.append((then, now))
        pairs = pairs[: self._config.places]
        if not pairs:
            return []
        parts: list[Mapping[str, Any]] = []
        for k, (then, now) in enumerate(pairs):
            for name, picture in (("then", then), ("now", now)):
                parts += [{"text": f"Place {k}, {name} ({picture.t:.0f} s):"}, gemini_service.image_part(picture.jpeg)]
        parts.append({"text": _question(text)})
        seen = _verdicts(gemini_service.read_json(self._service.ask(parts)), len(pairs))
        places = [_place(text, when, then, now, *seen[k]) for k, (then, now) in enumerate(pairs) if k in seen]
        return _fitting([place for place in places if place is not None], when)[:limit]

    def _same(self, one: _Picture, other: _Picture) -> bool:
        return one is other or bool(np.linalg.norm(one.at[:2] - other.at[:2]) <= self._near)

    def forget(self, text: str) -> int:
        """Forget nothing: whether a picture shows it only the model could say."""
        return 0

    def close(self) -> None:
        """Let go of nothing."""


def _question(text: str) -> str:
    return (
        f"Each place was photographed twice. Is there a {text.replace('_', ' ')} in the picture? Answer with a JSON "
        'list and nothing else; one entry per place: {"place": NUMBER, "then": true or false, "now": true or false}.'
    )


def _verdicts(said: Any, count: int) -> dict[int, tuple[bool, bool]]:
    """Return place -> whether it was there then, and now; what is no verdict is left out."""
    entries = cast("list[Any]", said if isinstance(said, list) else [said])
    found: dict[int, tuple[bool, bool]] = {}
    for entry in entries:
        if isinstance(entry, Mapping):
            k, then, now = (cast("Mapping[str, Any]", entry).get(name) for name in ("place", "then", "now"))
            if isinstance(k, int) and 0 <= k < count and isinstance(then, bool) and isinstance(now, bool):
                found.setdefault(k, (then, now))
    return found


def _place(text: str, when: When, then: _Picture, now: _Picture, was: bool, there: bool) -> Place | None:
    if when == "at":
        return Place(text, then.at, SCORE, then.t, then.t, "seen") if was else None
    if there:
        return Place(text, now.at, SCORE, min(then.t, now.t) if was else now.t, now.t, "seen")
    gone: Evidence = "moved" if when == "now" else "gone"
    return Place(text, then.at, SCORE, then.t, then.t, gone) if was else None


def _fitting(places: Sequence[Place], when: When) -> list[Place]:
    """Return the places that answer to `when`, the one seen last first; what moved only where nothing is there."""
    kept = [p for p in places if p.evidence == "seen"]
    if when == "history":
        kept = [p for p in places if p.evidence == "gone"]
    elif when == "anywhere" or not kept:
        kept = list(places)
    return sorted(kept, key=lambda p: -p.last_seen)


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
    """Puts proposed places into order; takes looks in, forgets and ends as a `Memory` does."""

    @property
    def last(self) -> float: ...

    def observe(self, observation: Observation) -> None: ...

    def order(self, text: str, when: When, at: float | None, proposed: Sequence[Place], limit: int) -> list[Place]:
        """Return those of the proposed places that answer, with what is known of their times, best first."""
        ...

    def forget(self, text: str) -> int: ...

    def close(self) -> None: ...


class ObjectJudge:
    """Orders places by an `ObjectMap`; see `PlaceJudge`."""

    def __init__(self, config: RerankedConfig) -> None:
        """Open it. Raises MemoryFault: its file cannot be used."""
        self._config = config
        self._objects = ObjectMap(config.objects)

    @property
    def last(self) -> float:
        return self._objects.last

    def observe(self, observation: Observation) -> None:
        self._objects.observe(observation)

    def order(self, text: str, when: When, at: float | None, proposed: Sequence[Place], limit: int) -> list[Place]:
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
        return self._objects.forget(text)

    def close(self) -> None:
        self._objects.close()


class Reranked:
    """Places of one memory in the order of another's evidence; see `Memory`."""

    def __init__(self, config: RerankedConfig | None = None) -> None:
        """Open both. Raises MemoryFault: no use of the objects' file; others as `FrameIndex` and `PictureJudge`."""
        self._config = c = config or RerankedConfig()
        make: Callable[[], Memory] = TopDownMap if c.proposer == "top_down_map" else lambda: FrameIndex(c.frames)
        self._proposer = make()
        self._judge: PlaceJudge = ObjectJudge(c) if c.judge == "objects" else PictureJudge(c.gemini, c.near)
        self.last = self._judge.last

    def observe(self, observation: Observation) -> None:
        check_observation(observation, self.last)
        self._judge.observe(observation)
        self._proposer.observe(observation)
        self.last = self._judge.last

    def query(self, text: str, when: When = "now", at: float | None = None, limit: int = 5) -> list[Place]:
        """See `Memory.query`: places that the judge confirms. Raises ServiceUnavailable: gemini does not answer."""
        check_query(text, when, at, limit)
        proposed = self._proposer.query(text, "anywhere", None, self._config.candidates)
        return self._judge.order(text, when, at, proposed, limit)

    def forget(self, text: str) -> int:
        proposed = self._proposer.forget(text)
        return proposed if self._config.judge == "gemini" else self._judge.forget(text)

    def close(self) -> None:
        self._proposer.close()
        self._judge.close()
