"""A user's module that looks through the interpreter for the simulation is stopped at the line that does."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import FrameType
from typing import Any

from golem.traces import is_users

SEARCHES = frozenset({"gc.get_objects", "gc.get_referrers", "gc.get_referents", "sys._getframe", "sys._current_frames"})
"""Audit events of CPython of what leads from a module to objects that it was not given."""
_open = 0


class Searched(RuntimeError):
    """A module looks for what it is not given."""


@contextmanager
def searching_forbidden() -> Iterator[None]:
    """Raise `Searched` in a user's file that calls one of `SEARCHES`, until the context is left."""
    global _open
    _install()
    _open += 1
    try:
        yield
    finally:
        _open -= 1


@cache
def _install() -> None:
    sys.addaudithook(_judge)  # it cannot be taken back


def _judge(event: str, arguments: tuple[Any, ...]) -> None:
    if not _open or event not in SEARCHES:
        return
    try:
        raise LookupError
    except LookupError as error:  # asking for the frame would be such an event itself
        frame: FrameType | None = None if error.__traceback__ is None else error.__traceback__.tb_frame.f_back
    while frame is not None and frame.f_globals.get("__name__") == "inspect":
        frame = frame.f_back
    if frame is not None and is_users(frame.f_code.co_filename):
        raise Searched(f"{event} looks through the interpreter; a module goes by what it is given")
