"""Calls what users gave a node. What that raises is logged, and does not end whoever polls the node.

A node may be polled by the process that balances a robot: no message, request or goal, whoever sent it, is worth that.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from typing import Any

from golem.errors import GolemError, shorten

REMEMBERED = 100
"""Kinds of errors that are told apart; beyond them nothing more is logged."""


def log_error(text: str) -> None:
    """Write a line to the standard error output."""
    print(text, file=sys.stderr, flush=True)


class CallbackGuard:
    """Counts what callbacks raise, and logs each kind of it once, with its traceback."""

    def __init__(self, log: Callable[[str], None] = log_error) -> None:
        """Log lines by `log`, which shall not hold its caller up."""
        self.count = 0
        self.log = log
        self._seen: set[tuple[object, ...]] = set()

    def call(self, where: str, callback: Callable[..., object], *arguments: Any) -> None:
        """Call `callback(*arguments)`, which belongs to `where`, and forget what it returns."""
        try:
            callback(*arguments)
        except Exception as error:  # a user's callback may raise anything
            self.caught(where, error)

    def caught(self, where: str, error: BaseException) -> str:
        """Log `error`, which a callback of `where` raised, and return it as one sentence.

        A `GolemError` is somebody's input: it is told to whoever sent that, and not logged.
        """
        self.count += 1
        text = str(error).encode("utf-8", "replace").decode()
        if isinstance(error, GolemError):
            return text
        sentence = f"{where} failed: {type(error).__name__}: {shorten(text, 300)}"
        last = error.__traceback__
        while last is not None and last.tb_next is not None:
            last = last.tb_next
        kind = (where, type(error), None if last is None else (last.tb_frame.f_code, last.tb_lineno))
        if kind not in self._seen and len(self._seen) < REMEMBERED:
            self._seen.add(kind)
            self.log(f"{sentence}\n{''.join(traceback.format_exception(error)).rstrip()}")
        return sentence
