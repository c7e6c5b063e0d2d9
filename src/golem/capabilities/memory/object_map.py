"""A memory of objects: looks are put to objects by their places, and a look through a place takes its object away."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from golem.capabilities.memory import memory_file
from golem.capabilities.memory.base import Evidence, Observation, Place, When, check_observation, check_query
from golem.capabilities.memory.memory_file import BELIEF, EVIDENCE, FIRST, GONE, LAST, LOOKS, PLACE, SIZE, VARIANCE
from golem.capabilities.memory.words import label_scores
from golem.capabilities.perception.lift import standing_middle
from golem.errors import ConfigError
from golem.robots.sensors.cameras import project
from golem.types import Array, LocalizedObject, RgbdImage

BEHIND = 0.05
"""How far behind an object's place, its middle, and the standard deviation the surface of a look through it has to be
[m]: what is seen of itself is hardly behind that."""
LEVEL = 0.3
"""Sine of the angle off the vertical from which on a view has an upper half."""
SHARE = 0.9
"""Share of the window that has to be seen through."""
MARGIN = 1.5
"""The window is wider than the object by this many standard deviations of its place, to each side."""
SMALLEST = 3
"""Least half width of a window [px]; a smaller object's absence is not judged."""
VALID = 0.5
"""Least share of a window with depth."""


class Look(Enum):
    """What a look says of one expected object."""

    OUT_OF_VIEW = "out of view"
    HIDDEN = "hidden"
    EMPTY = "empty"
    THROUGH = "through"


def look_at(frame: RgbdImage, positions: Array, sizes: Array, sigmas: Array) -> list[Look]:
    """Return what the frame says of objects that it did not detect.

    Args:
        positions: (n, 3) where they are expected, in the frame of `frame.T_odom_optical` [m].
        sizes: (n,) their radii [m].
        sigmas: (n,) standard deviations of their positions, relative to the frame [m].
    """
    info = frame.info
    T = np.linalg.inv(frame.T_odom_optical)
    optical = np.asarray(positions, float) @ T[:3, :3].T + T[:3, 3]
    out = [Look.OUT_OF_VIEW] * len(optical)
    depth, up = optical[:, 2], T[:2, 2]
    near = (depth > info.near) & (depth < info.far)
    for k in np.flatnonzero(near):
        x, y = project(info, optical[k])
        half = info.fx * (sizes[k] + MARGIN * sigmas[k]) / depth[k]
        x0, x1, y0, y1 = round(x - half), round(x + half), round(y - half), round(y + half)
        if half < SMALLEST or x0 < 0 or y0 < 0 or x1 >= info.width or y1 >= info.height:
            continue
        window = frame.depth[y0 : y1 + 1, x0 : x1 + 1]
        if np.hypot(*up) > LEVEL:  # below its middle is what it stands on
            right, down = np.arange(x0, x1 + 1) - x, np.arange(y0, y1 + 1) - y
            window = window[up[0] * right[None, :] + up[1] * down[:, None] >= 0.0]
        valid = window[window > 0.0]
        if len(valid) < VALID * window.size:
            continue
        behind = np.mean(valid > depth[k] + sigmas[k] + BEHIND)
        before = np.mean(valid < depth[k] - sizes[k] - MARGIN * sigmas[k] - BEHIND)
        if behind >= SHARE:
            out[k] = Look.THROUGH
        else:
            out[k] = Look.HIDDEN if before > 1.0 - SHARE else Look.EMPTY
    return out


LEAST = 0.15
"""Log odds of a detection that is as likely wrong as right, by its score: what is found again and again is there."""
LARGEST = 0.3
"""Largest radius that an object is taken to have [m]."""


def update(row: Array, place: Array, variance: float, gain: float, ceiling: float, t: float) -> None:
    """Put a look at `place` to an object, whose row is changed.

    The variance does not fall below a quarter of the look's: the errors of poses are those of a drift, and do not
    average out.
    """
    fused = 1.0 / (1.0 / row[VARIANCE] + 1.0 / variance)
    row[PLACE] += fused / variance * (place - row[PLACE])
    row[VARIANCE] = max(fused, variance / 4.0)
    row[BELIEF] = min(row[BELIEF] + gain, ceiling)
    row[EVIDENCE] += gain
    row[LAST] = t
    row[LOOKS] += 1.0


def gain_of(score: float, most: float) -> float:
    """Return the log odds that a detection with this score is right, from `LEAST` to `most`."""
    share = min(max(score, 0.5), 0.999)
    return min(max(math.log(share / (1.0 - share)), LEAST), most)


def place_of(found: LocalizedObject, eye: Array) -> Array:
    """Return the place of an object (3,) [m] seen from `eye` (3,): its middle, which looks from elsewhere show, too."""
    if len(found.points) < 4:
        return found.position
    return np.array([*standing_middle(found.points, eye), found.position[2]])


def size_of(found: LocalizedObject) -> float:
    """Return the radius of an object [m], by the spread of its points."""
    if len(found.points) < 4:
        return 0.03
    spread = np.median(np.linalg.norm(found.points - np.median(found.points, axis=0), axis=1))
    return float(np.clip(1.5 * spread, 0.02, LARGEST))


def outvoted(records: memory_file.ObjectRecords, row: int, gate: float, tie: float) -> bool:
    """Return whether the object of a row is rather another kind's, at whose place it is.

    Two bodies cannot be in one place: a detector that names them by turns has one of them before it. It is of the kind
    for which there is more evidence; where there is as much for both, both are answered.

    Args:
        gate: within how many standard deviations two places are one.
        tie: difference of log odds up to which there is as much evidence for both.
    """
    values = records.values
    rivals = _rivals(records, row, gate)
    return len(rivals) > 0 and bool(np.any(values[rivals, EVIDENCE] > values[row, EVIDENCE] + tie))


def _rivals(records: memory_file.ObjectRecords, row: int, gate: float) -> NDArray[np.intp]:
    """Return the rows of what may be the same body under another name.

    Their lives overlap, and so does the time in which they were seen, unless this one was seen once only: what was
    seen several times after the other, and the other no more, has taken its place. What was found in the newest look
    at both are two bodies.
    """
    values, mine = records.values, records.values[row]
    # What may be anywhere, by its variance, is no rival of what is known to be here: the smaller variance counts.
    most = LARGEST + gate * math.sqrt(2.0 * mine[VARIANCE])
    near = np.flatnonzero(np.abs(values[:, 0] - mine[0]) <= most)  # most are far off along one axis already
    near = near[np.abs(values[near, 1] - mine[1]) <= most]
    if len(near) == 1:  # itself
        return near[:0]
    others, label = values[near], records.label(row)
    sigma = np.sqrt(2.0 * np.minimum(others[:, VARIANCE], mine[VARIANCE]))
    reach = np.maximum(others[:, SIZE], mine[SIZE]) + gate * sigma
    same_place = np.linalg.norm(others[:, PLACE] - mine[PLACE], axis=1) <= reach
    alive_together = _overlap(others, mine, GONE)
    seen_by_turns = _overlap(others, mine, LAST) if mine[LOOKS] > 1.0 else alive_together
    chosen = near[same_place & alive_together & seen_by_turns & (others[:, LAST] != mine[LAST])]
    return np.array([k for k in chosen if records.label(k) != label], np.intp)


def _overlap(others: Array, mine: Array, end: int) -> NDArray[np.bool_]:
    """Return which of the spans of time from the first look to the column `end` have some in common with one."""
    return (others[:, FIRST] <= mine[end]) & (mine[FIRST] <= others[:, end])


FORBIDDEN = 1e9
"""Cost of a pair outside the gate."""


@dataclass(frozen=True, slots=True)
class ObjectMapConfig:
    """How objects are remembered.

    Attributes:
        file: where they are kept; None keeps them in this process alone.
        gate: distance at which a look can no longer be of an object, in standard deviations of both.
        depth_noise: standard deviation of a position at 1 m, growing with the square of the distance [m].
        found: most log odds of one detection. Its score is taken as the share of such detections that are right.
        missed: log odds of a look at a place whose object was not detected though nothing hides it.
        through: the same of a look through the place.
        ceiling: highest log odds that it is there; below `-through`, so that one look through a place is enough.
        sure: log odds that it ever was there, of all looks that found and missed it, from which on it is answered; one
            look with a score of 0.65 gives as much.
        most: most objects that are kept; the longest gone are forgotten first, then the longest unseen.
    """

    file: str | None = None
    gate: float = 3.0
    depth_noise: float = 0.01
    found: float = 2.0
    missed: float = -0.35
    through: float = -3.0
    ceiling: float = 2.5
    sure: float = 0.6
    most: int = 10_000

    def __post_init__(self) -> None:
        if not (self.gate > 0 and self.depth_noise > 0 and self.found > 0 and self.ceiling > 0 and self.most > 0):
            raise ConfigError("The options gate, depth_noise, found, ceiling and most of object_map are above 0.")
        if not (self.missed <= 0 and self.through < 0):
            raise ConfigError("The options missed and through of object_map are log odds below 0.")


class ObjectMap:
    """The objects that were seen, where they are, and where they were; see `Memory` and `HasPlaces`."""

    def __init__(self, config: ObjectMapConfig | None = None) -> None:
        """Open the memory. Raises MemoryFault: the file cannot be used."""
        self._config = config or ObjectMapConfig()
        self._records = memory_file.ObjectRecords()
        self.last = -math.inf
        self._file = None if self._config.file is None else memory_file.MemoryFile(Path(self._config.file))
        if self._file is not None:
            self._read(self._file)

    def _read(self, file: memory_file.MemoryFile) -> None:
        self._records = memory_file.ObjectRecords()
        rows, self.last = file.read()
        for row in rows:
            self._records.add(row.label, row.values, row.number)

    def __len__(self) -> int:
        """Return how many objects are remembered, gone ones included."""
        return len(self._records)

    def observe(self, observation: Observation) -> None:
        check_observation(observation, self.last)
        changed = self._match(observation) | self._miss(observation)
        removed = self._never_were() | self._bound()
        self.last = observation.frame.t
        self._keep(changed - removed, removed)

    def _keep(self, changed: set[int], removed: set[int]) -> None:
        if self._file is None:
            return
        try:
            self._file.write([self._records.row(number) for number in sorted(changed)], removed, self.last)
        except BaseException:
            self._read(self._file)
            raise

    def _match(self, observation: Observation) -> set[int]:
        """Put each detection to an object that may be there, or make a new one; return their numbers."""
        config, records, frame = self._config, self._records, observation.frame
        eye = frame.T_odom_optical[:3, 3]
        changed: set[int] = set()
        for label in dict.fromkeys(found.label for found in observation.objects):
            seen = [found for found in observation.objects if found.label == label]
            places = np.array([place_of(found, eye) for found in seen])
            far = np.linalg.norm(places - eye, axis=1)
            variances = observation.pose_sigma**2 + (config.depth_noise * far**2) ** 2
            rows = records.rows(label)
            rows = rows[np.isinf(records.values[rows, GONE])]
            known = records.values[rows]
            distance = np.linalg.norm(places[:, None] - known[None, :, PLACE], axis=2)
            reach = known[:, SIZE] + config.gate * np.sqrt(variances[:, None] + known[None, :, VARIANCE])
            pairs = np.full((len(seen), len(seen)), FORBIDDEN / 2)  # to each detection a new object of its own
            cost = np.hstack([np.where(distance <= reach, distance, FORBIDDEN), pairs])
            for k, column in zip(*linear_sum_assignment(cost), strict=True):
                gain = gain_of(seen[k].detection.score, config.found)
                if column < len(rows):
                    row = rows[column]
                    update(records.values[row], places[k], variances[k], gain, config.ceiling, frame.t)
                    changed.add(int(records.numbers[row]))
                else:
                    values = np.array(
                        [*places[k], variances[k], size_of(seen[k]), gain, frame.t, frame.t, math.inf, 1.0, gain]
                    )
                    changed.add(records.add(label, values))
        return changed

    def _miss(self, observation: Observation) -> set[int]:
        """Doubt the objects that should have been seen; return the numbers of those that are doubted more."""
        config, records, frame = self._config, self._records, observation.frame
        asked = [records.rows(label) for label in dict.fromkeys(observation.labels)]
        rows = np.concatenate(asked) if asked else np.empty(0, np.intp)
        values = records.values
        rows = rows[np.isinf(values[rows, GONE]) & (values[rows, LAST] < frame.t)]
        sigmas = np.sqrt(values[rows, VARIANCE] + observation.pose_sigma**2)
        changed: set[int] = set()
        for row, look in zip(rows, look_at(frame, values[rows, PLACE], values[rows, SIZE], sigmas), strict=True):
            if look in (Look.THROUGH, Look.EMPTY):
                values[row, BELIEF] += config.through if look is Look.THROUGH else config.missed
                values[row, EVIDENCE] += 0.0 if look is Look.THROUGH else config.missed
                if values[row, BELIEF] < 0.0:
                    values[row, GONE] = frame.t
                changed.add(int(records.numbers[row]))
        return changed

    def _never_were(self) -> set[int]:
        """Forget what is gone and was never sure; return the numbers."""
        values = self._records.values
        doubtful = (values[:, EVIDENCE] < self._config.sure) & ~np.isinf(values[:, GONE])
        return self._remove(int(n) for n in self._records.numbers[doubtful])

    def _bound(self) -> set[int]:
        """Forget what is too much; return the numbers."""
        over = len(self._records) - self._config.most
        if over <= 0:
            return set()
        values = self._records.values
        worth = np.where(np.isinf(values[:, GONE]), values[:, LAST] + 1e12, values[:, GONE])
        return self._remove(int(n) for n in self._records.numbers[np.argsort(worth, kind="stable")[:over]])

    def _remove(self, numbers: Iterable[int]) -> set[int]:
        removed = set(numbers)
        for number in removed:
            self._records.remove(number)
        return removed

    def query(self, text: str, when: When = "now", at: float | None = None, limit: int = 5) -> list[Place]:
        """See `Memory.query`.

        Now, the object that was seen last comes first; objects that are gone are only named, as moved, where none of
        their kind is left. In history, where it was last comes first.
        """
        check_query(text, when, at, limit)
        places = [
            place
            for label, score in label_scores(text, self._records.labels).items()
            for place in self._places(label, score, when, at, limit)
        ]
        return sorted(places, key=lambda p: (-p.score, -p.last_seen))[:limit]

    def places(self, limit: int) -> list[Place]:
        found = [place for label in self._records.labels for place in self._places(label, 1.0, "anywhere", None, limit)]
        return sorted(found, key=lambda p: -p.last_seen)[:limit]

    def _places(self, label: str, score: float, when: When, at: float | None, limit: int) -> list[Place]:
        """Return those of one label that fit, at most `limit`, the one seen last first."""
        values = self._records.values
        rows = self._records.rows(label)
        rows = rows[values[rows, EVIDENCE] >= self._config.sure]
        there = np.isinf(values[rows, GONE])
        absent: Evidence = "moved" if when == "now" else "gone"
        if when == "now":
            fitting = self._newest(rows[there], limit) or self._newest(rows[~there], limit)
        elif when == "history":
            fitting = self._newest(rows[~there], limit)
        elif when == "at":
            assert at is not None
            fitting = self._newest(rows[(values[rows, FIRST] <= at) & (at < values[rows, GONE])], limit)
        else:
            fitting = self._newest(rows, limit)
        return [
            Place(
                label, value[PLACE].copy(), score, float(value[FIRST]), float(value[LAST]),
                "seen" if math.isinf(value[GONE]) else absent,
                {"belief": float(value[BELIEF]), "looks": float(value[LOOKS]),
                 "sigma": float(np.sqrt(value[VARIANCE]))},
            )
            for value in values[fitting]
        ]  # fmt: skip

    def _newest(self, rows: NDArray[np.intp], limit: int) -> list[int]:
        """Return those that were not misnamed, the one seen last first; at most `limit`."""
        order = np.argsort(-self._records.values[rows, LAST], kind="stable")
        config = self._config
        kept = (int(row) for row in rows[order] if not outvoted(self._records, row, config.gate, -config.missed))
        return list(islice(kept, limit))

    def forget(self, text: str) -> int:
        check_query(text, "anywhere", None, 1)
        numbers = self._remove(
            int(self._records.numbers[row])
            for label in label_scores(text, self._records.labels)
            for row in self._records.rows(label)
        )
        self._keep(set(), numbers)
        return len(numbers)

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
