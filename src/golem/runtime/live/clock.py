"""The robot's time as others see it: it stands still, jumps back when the robot restarts, and never runs backwards."""

from __future__ import annotations

import math

BACK = 0.1
"""How far back a stamp of one writer must be to mean a restart, not a sample that was overtaken [s]."""


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
