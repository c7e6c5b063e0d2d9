"""How far a run is: a bar in a terminal, and a line now and then in a pipe or a log file."""

from __future__ import annotations

import sys
import time
from typing import Any

from tqdm import tqdm

PERIOD = 30.0
"""Time between two lines [s]."""


class Progress:
    """Shows on stderr how many trials are done."""

    def __init__(self, kept: int) -> None:
        """Begin with `kept` trials of an earlier run."""
        self._terminal = sys.stderr.isatty()
        self._bar: Any = tqdm(initial=kept, unit="trial", disable=not self._terminal)
        self._done, self._lost, self._began, self._here = kept, 0, time.monotonic(), 0
        self._next = self._began

    def expect(self, total: int) -> None:
        """Say how many trials there will be, as far as is known."""
        self._bar.total = total
        self._bar.refresh()

    def step(self, success: bool) -> None:
        """Count one more finished trial."""
        self._done, self._here, self._lost = self._done + 1, self._here + 1, self._lost + (not success)
        self._bar.update()
        self._bar.set_postfix(lost=self._lost, refresh=False)
        now, total = time.monotonic(), int(self._bar.total or 0)
        if not self._terminal and (now >= self._next or self._done == total):
            self._next = now + PERIOD
            left = (now - self._began) / self._here * (total - self._done)
            self.say(f"{self._done} of {total} trials, {self._lost} lost, about {left:.0f} s left")

    def say(self, text: str) -> None:
        """Print lines without tearing the bar apart."""
        tqdm.write(text, file=sys.stderr)
        sys.stderr.flush()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the bar as it is."""
        self._bar.close()
