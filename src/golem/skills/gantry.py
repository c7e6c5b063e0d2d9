"""A gantry that loosens fasteners beside the robot: what it says, where it works, and what it is done with."""

from __future__ import annotations

import re

from golem.interfaces import topics
from golem.middleware.bus import News
from golem.skills.context import Context
from golem.skills.job_file import JobFile

SENTENCE = re.compile(r"\s*Remove: (\S.{0,59}) with confidence = (\S{1,20})\s*")
"""On the topic `/triggered_behavior`."""
KEEP_OFF = 0.9
"""Distance from where the gantry works at which nobody stands or reaches [m] [own]."""
SILENT = 90.0
"""Time without a word after which no more is waited for [s]; a removal takes RAPID 20 s."""


class Gantry:
    """Listens at every tick.

    Attributes:
        at: name of the fastener it is at, where it stays until it says another one; empty before its first word.
        t: time of its last word [s], first that of the beginning.
    """

    def __init__(self, context: Context, book: JobFile) -> None:
        """Hear what comes from now on, in the stack of `context`, of the fasteners of `book`, which keeps it."""
        self._context, self._book, self._news = context, book, News(context.bus, topics.REMOVALS)
        self._names = {one.listed.name for one in book.fasteners}
        self.at, self.t = "", context.t

    def __call__(self) -> None:
        said = SENTENCE.fullmatch((self._news.read() or "")[:200])
        name = " ".join(said[1].split()) if said else ""  # as in a list
        if name in self._names:
            if self.at not in (name, ""):
                self._book.loosen(self.at)
            self.at, self.t = name, self._context.t

    @property
    def silent(self) -> bool:
        """Whether nothing more is to be expected of it."""
        return self._context.t - self.t > SILENT
