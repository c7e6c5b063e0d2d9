"""Compares the time that a module's calls take with the time that it declares, and warns of one far beyond it.

In lock-step a module pays by the latency that it declares, and no result depends on what this measures; it is a word
to the user, beside the results.
"""

from __future__ import annotations

import math
import time
import warnings

from golem.errors import SlowModule

FIRST, STRIDE = 8, 7
"""Which calls are measured: the first ones, then one in `STRIDE`. A look at the thread's clock takes up to 2 us."""
FAR = 3.0
"""CPU time over allowed time from which on a call is slow [own: what another computer or a cold cache explains]."""
WAITING, PATIENCE = 10.0, 0.04
"""The same for the wall clock, and time that is never long [s]: it also counts sleeping, and other processes [own]."""
MIN_SLOW, MAX_SLOW_RATIO = 5, 0.2
"""A module is named once so many measured calls were slow, and this share of all."""


class CallTimes:
    """Samples the calls of one module.

    Attributes:
        allowed: time that a call may take [s]: its period, and the latency it declares. Infinite: none is measured.
    """

    def __init__(self) -> None:
        """Measure nothing until `allowed` is set."""
        self.allowed = math.inf
        self._calls = self._measured = self._slow = 0
        self._sum = 0.0

    def start(self) -> tuple[float, float] | None:
        """Return the wall clock and the thread's [s] where the call that begins is to be measured."""
        self._calls += 1
        if self.allowed == math.inf or (self._calls > FIRST and self._calls % STRIDE):
            return None
        return time.perf_counter(), time.thread_time()

    def stop(self, started: tuple[float, float], who: str) -> None:
        """Take in a call that has ended; warn, once, where the module `who` is slow."""
        wall, cpu = time.perf_counter() - started[0], time.thread_time() - started[1]
        self._measured += 1
        if cpu <= FAR * self.allowed and wall <= max(WAITING * self.allowed, PATIENCE):
            return
        self._slow += 1
        self._sum += cpu if cpu > FAR * self.allowed else wall
        if self._slow >= MIN_SLOW and self._slow > MAX_SLOW_RATIO * self._measured:
            mean = self._sum / self._slow
            text = (
                f"{who} takes {1e3 * mean:.3g} ms a call; its period and the latency it declares allow "
                f"{1e3 * self.allowed:.3g} ms, so that a real robot would wait for it."
            )
            warnings.warn(text, SlowModule, stacklevel=2)
            self.allowed = math.inf
