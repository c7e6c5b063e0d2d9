"""The clock of a device that runs from its own power-on.

Its offset to ours is the smallest that was seen of late: a message may be held up on its way, but none arrives before
it was sent.
"""

from __future__ import annotations

import math
from collections import deque

WINDOW = 10.0
"""Time over which the smallest offset counts [s]: clocks drift by less than 1 ms meanwhile."""


class DeviceClock:
    """Turns the device's time into ours."""

    def __init__(self) -> None:
        self._delays: deque[tuple[float, float]] = deque()

    def add(self, device: float, t: float) -> None:
        """Take in that what was sent at `device` arrived at `t` [s], in the order of `t`."""
        offset = t - device
        while self._delays and self._delays[-1][1] >= offset:
            self._delays.pop()
        self._delays.append((t, offset))
        while self._delays[0][0] < t - WINDOW:
            self._delays.popleft()

    def reset(self) -> None:
        """Forget everything: the device was started again."""
        self._delays.clear()

    def ours(self, device: float) -> float:
        """Return our time at the device's time `device` [s]; nan before the first message."""
        return device + self._delays[0][1] if self._delays else math.nan
