"""What a process does not take, counted and said: who sent it would else look for the mistake anywhere but there."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

QUIET = 5.0
"""Time between two complaints of one kind [s]."""


class RejectedMessages:
    """Messages of one kind that were refused; the first is said at once.

    Attributes:
        count: how many.
        why: the reason of the last one.
    """

    def __init__(
        self, what: str, tell: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Call a message `what`; `tell` a person, without being held up, on this process's own `clock` [s]."""
        self._what, self._tell, self._clock = what, tell, clock
        self.count, self.why = 0, ""
        self._said = -math.inf

    def add(self, error: Exception) -> None:
        """Count one more."""
        self.count, self.why = self.count + 1, str(error)
        now = self._clock()
        if now - self._said >= QUIET:
            self._said = now
            self._tell(f"{self.count} {self._what} refused so far, the last one because: {error}")
