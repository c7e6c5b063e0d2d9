"""What is told to people on the bus: of a memory, and in pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class MemoryStatus:
    """What became of the looks that a memory was given.

    Attributes:
        t: time of the newest [s]; before the first, when the memory began.
        frame: frame of the places: `map`, or `odom` without a map.
        epoch: what is added to the robot's time for times of the memory [s].
        looks: how many were taken in since the stack began.
        problem: why the newest was not; empty where it was.
    """

    t: float
    frame: str
    epoch: float
    looks: int
    problem: str = ""


@dataclass(frozen=True, slots=True)
class RememberedPlace:
    """One place, for people.

    Attributes:
        label: what is or was there.
        x, y: where [m].
        age: time since it was seen last [s].
        there: whether nothing speaks against it.
    """

    label: str
    x: float
    y: float
    age: float
    there: bool


@dataclass(frozen=True, slots=True)
class RememberedPlaces:
    """What a memory would show.

    Attributes:
        frame: of the places: `map`, or `odom` without a map.
        places: the ones seen last.
    """

    frame: str
    places: tuple[RememberedPlace, ...]


@dataclass(frozen=True, slots=True)
class ShownPicture:
    """A picture (height, width, 3) uint8 for people, of the time `t` [s]."""

    t: float
    rgb: NDArray[np.uint8]
