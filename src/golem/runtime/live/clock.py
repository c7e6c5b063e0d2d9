"""The robot's time as others see it: it stands still, jumps back when the robot restarts, and never runs backwards."""

from __future__ import annotations

import math
import time

BACK = 0.1
"""How far back a stamp of one writer must be to mean a restart, not a sample that was overtaken [s]."""


WINDOW = 1.0
"""Time over which two clocks are compared [s]."""
AGREEMENT = (0.9, 1.1)
"""Rates of the robot's time that are taken for ours [own: what arrives may be late by 50 ms at either end]."""


def time_since_boot() -> float:
    """Return a monotonic time that goes on while the machine sleeps, where the system has one [s]."""
    clock = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
    return time.clock_gettime(clock)


class Rate:
    """How fast the robot's time runs by our clock: 2 ms a state if its unit is what we take it for.

    Attributes:
        value: over the last `WINDOW`; None before the first.
    """

    def __init__(self) -> None:
        """Start before the first state."""
        self.value: float | None = None
        self._since: tuple[float, float] | None = None

    def add(self, t: float, now: float) -> None:
        """Take in the stamp `t` of a state that arrived at `now` [s]."""
        if self._since is None or t < self._since[0]:
            self._since = (t, now)
        elif now - self._since[1] >= WINDOW:
            self.value = (t - self._since[0]) / (now - self._since[1])
            self._since = (t, now)

    def doubt(self) -> str:
        """Return why the robot's time cannot be relied on; empty if it can."""
        if self.value is None:
            return f"the robot's time is compared with ours for {WINDOW:g} s first"
        least, most = AGREEMENT
        return "" if least <= self.value <= most else f"the robot's time runs at {self.value:.2f} of ours"


class RobotClock:
    """Judges the stamps of the robot's states.

    Attributes:
        t: newest time [s]; -inf before the first.
    """

    def __init__(self) -> None:
        """Start before the first state."""
        self.t = -math.inf
        self._writer: int | None = None

    def restarted(self, t: float, writer: int) -> bool:
        """Return whether a state with stamp `t` [s] from `writer` is of a robot that was started anew.

        A writer that is merely another does not mean that: one that was lost for long comes back as another.
        """
        overtaken = writer == self._writer and t >= self.t - BACK
        return t < self.t and not overtaken

    def advances(self, t: float, writer: int) -> bool:
        """Return whether a state is new, and remember it if so; one that repeats or was overtaken is not."""
        if not self.restarted(t, writer) and t <= self.t:
            return False
        self.t, self._writer = t, writer
        return True


class Every:
    """Tells when something is due again."""

    def __init__(self, period: float) -> None:
        """Be due every `period` [s], the first time at once."""
        self._period, self._last = period, -math.inf

    def due(self, now: float) -> bool:
        """Return whether it is due at `now` [s]."""
        if now - self._last < self._period:
            return False
        self._last = now
        return True
