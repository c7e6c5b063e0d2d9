"""What a memory tells of itself on the bus."""

from __future__ import annotations

from dataclasses import dataclass


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
