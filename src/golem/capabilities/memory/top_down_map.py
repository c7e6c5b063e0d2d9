"""A memory of cells: what was seen above each cell of the floor is averaged, and the best cells for the words answer.

After VLMaps (Huang et al., 2023), with the labels of a localizer in the place of the features of a network: what was
taken away is only forgotten as looks without it are averaged in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from golem.capabilities.memory.base import Observation, Place, When, apart, check_observation, check_query
from golem.capabilities.memory.words import label_scores
from golem.capabilities.perception.lift import scene_of
from golem.errors import ConfigError
from golem.types import Array

STRIDE = 16
"""Every such point of the cloud counts for the cells without an object."""


@dataclass(frozen=True, slots=True)
class TopDownMapConfig:
    """How cells are remembered.

    Attributes:
        cell: side of a cell [m].
        spread: places closer to a better one than this are left out of an answer [m].
        most: most cells; the longest unseen are forgotten first.
    """

    cell: float = 0.1
    spread: float = 0.5
    most: int = 200_000

    def __post_init__(self) -> None:
        if not (self.cell > 0.0 and self.spread >= 0.0 and self.most > 0):
            raise ConfigError("Of top_down_map, cell and most are above 0, and spread is at least 0.")


@dataclass(slots=True)
class _Cell:
    """One cell: how often it was seen, what of, how high, and when."""

    first: float
    last: float = 0.0
    looks: float = 0.0
    shares: dict[str, float] = field(default_factory=dict[str, float])
    heights: dict[str, float] = field(default_factory=dict[str, float])


class TopDownMap:
    """What is above each cell of the floor; see `Memory`."""

    def __init__(self, config: TopDownMapConfig | None = None) -> None:
        self._config = config or TopDownMapConfig()
        self._cells: dict[tuple[int, int], _Cell] = {}
        self.last = -math.inf

    def observe(self, observation: Observation) -> None:
        check_observation(observation, self.last)
        t = self.last = observation.frame.t
        for key in self._keys(scene_of(observation.frame)[::STRIDE]):
            cell = self._cells.setdefault(key, _Cell(t))
            cell.last, cell.looks = t, cell.looks + 1.0
        for found in observation.objects:
            points = found.points if len(found.points) else found.position[None]
            for key in self._keys(points):
                cell = self._cells.setdefault(key, _Cell(t, looks=1.0))
                cell.last = t
                cell.shares[found.label] = cell.shares.get(found.label, 0.0) + found.detection.score
                cell.heights[found.label] = float(found.position[2])
        self._bound()

    def _keys(self, points: Array) -> list[tuple[int, int]]:
        cells = np.unique(np.floor(points[:, :2] / self._config.cell).astype(int), axis=0)
        return [(int(x), int(y)) for x, y in cells]

    def _bound(self) -> None:
        over = len(self._cells) - self._config.most
        if over > 0:
            for key in sorted(self._cells, key=lambda k: self._cells[k].last)[:over]:
                del self._cells[key]

    def query(self, text: str, when: When = "now", at: float | None = None, limit: int = 5) -> list[Place]:
        """See `Memory.query`; `when` counts for nothing."""
        check_query(text, when, at, limit)
        labels = {label for cell in self._cells.values() for label in cell.shares}
        found: list[Place] = []
        for label, score in label_scores(text, labels).items():
            for (x, y), cell in self._cells.items():
                share = cell.shares.get(label, 0.0) / max(cell.looks, 1.0)
                if share > 0.0:
                    place = np.append(self._config.cell * (np.array([x, y]) + 0.5), cell.heights[label])
                    found.append(Place(label, place, score * min(share, 1.0), cell.first, cell.last, "similar"))
        return apart(sorted(found, key=lambda p: -p.score), self._config.spread, limit)

    def forget(self, text: str) -> int:
        """See `Memory.forget`: cells forget what the words name."""
        check_query(text, "anywhere", None, 1)
        count = 0
        for cell in self._cells.values():
            for label in label_scores(text, cell.shares):
                del cell.shares[label]
                count += 1
        return count

    def close(self) -> None:
        """See `Memory.close`."""
