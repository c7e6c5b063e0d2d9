"""The robot's time as others see it: it stands still, jumps back when the robot restarts, and never runs backwards."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Container

GONE = 0.2
"""Silence after which a robot's writer is taken for gone [s]: a hundred states."""
BACK = 0.1
"""How far back a stamp of one writer must be to mean a restart, not a sample that was overtaken [s]."""


WINDOW = 1.0
"""Time over which two clocks are compared [s]."""
AGREEMENT = (0.9, 1.1)
"""Rates of the robot's time that are taken for ours [own: what arrives may be late by 50 ms at either end]."""


def time_since_boot() -> float:
    """Return a monotonic time that goes on while the machine sleeps, where the system has one [s]."""
    return time.clock_gettime(getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC))


class Rate:
    """How fast the robot's time runs by our clock: 2 ms a state if its unit is what we take it for.

    Its `value` is over the last `WINDOW`; None before the first.
    """

    def __init__(self) -> None:
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
        minimum, maximum = AGREEMENT
        return "" if minimum <= self.value <= maximum else f"the robot's time runs at {self.value:.2f} of ours"


class RobotClock:
    """Judges the stamps of the robot's states.

    States of another writer do not count while the one that is known writes: of two robots, whose clocks differ, each
    would else be the other one restarted, at every state.

    Attributes:
        t: newest time [s]; -inf before the first.
        heard: when its newest state came [s]; -inf before the first.
        restarted: whether the state that was judged last is the first of a robot that was restarted.
    """

    def __init__(self, now: Callable[[], float], writers: Callable[[], Container[int]]) -> None:
        """Start before the first state; `now` is this process's own clock [s].

        Who writes states is among the `writers`; one that was killed for ten seconds more.
        """
        self.t, self.heard, self.restarted = -math.inf, -math.inf, False
        self._now, self._writers = now, writers
        self._writer: int | None = None

    @property
    def known(self) -> bool:
        """Whether a robot has been heard."""
        return self._writer is not None

    def advances(self, t: float, writer: int) -> bool:
        """Return whether a state with stamp `t` [s] from `writer` is new, and remember it if so.

        One that repeats or was overtaken is not, nor is a second robot's. A writer that is merely another does not mean
        that the robot was restarted: one that was lost for long comes back as another.
        """
        known, now = self._writer, self._now()
        foreign = known is not None and known != writer and now - self.heard < GONE and known in self._writers()
        overtaken = writer == known and t >= self.t - BACK
        self.restarted = t < self.t and not overtaken and not foreign
        if foreign or not (self.restarted or t > self.t):
            return False
        self.t, self._writer, self.heard = t, writer, now
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
