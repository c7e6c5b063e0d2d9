"""Notices what a module does behind its caller's back: clock, files, threads, randomness that everybody shares.

The profiler of the interpreter reports every call of a function in C, by whatever name the module has imported it.
"""

from __future__ import annotations

import datetime
import random
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

import numpy as np

from golem.package_data import load_data
from golem.traces import caller

CLOCK, FILE, THREAD, RANDOM = "clock", "file", "thread", "random"
_WATCHED: dict[str, dict[str, list[str]]] = load_data(__package__, "impurities.yaml")
_FUNCTIONS = {(module, name): kind for kind, of in _WATCHED.items() for module, names in of.items() for name in names}
_PACKAGES = tuple({f"{sysconfig.get_path(name)}/" for name in ("purelib", "platlib")})
_METHODS = {(datetime.datetime, name): CLOCK for name in ("now", "utcnow")} | {(datetime.date, "today"): CLOCK}


@dataclass(frozen=True, slots=True)
class Impurity:
    """One thing that was done.

    Attributes:
        kind: `CLOCK`, `FILE`, `THREAD` or `RANDOM`.
        what: the function, e.g. `time.perf_counter`.
        where: line of the module, e.g. `my_arms.py:12`; empty where it is unknown.
    """

    kind: str
    what: str
    where: str


@contextmanager
def impurities() -> Iterator[list[Impurity]]:
    """Collect what is done in this thread until the context is left.

    What the package's own machinery does around a module is left out, and a library that measures its own time. A
    profiler that was at work before is put back.
    """
    found: list[Impurity] = []

    def profile(frame: FrameType, event: str, function: Any) -> None:
        kind = _kind(function) if event == "c_call" else None
        measures_itself = kind == CLOCK and frame.f_code.co_filename.startswith(_PACKAGES)
        where = None if kind is None or measures_itself else caller(frame)
        if kind is not None and where is not None:
            name = getattr(function, "__name__", "?")
            found.append(Impurity(kind, f"{getattr(function, '__module__', None) or 'datetime'}.{name}", where))

    before = sys.getprofile()
    states = random.getstate(), _legacy_state()
    sys.setprofile(profile)
    try:
        yield found
    finally:
        sys.setprofile(before)
        if random.getstate() != states[0]:
            found.append(Impurity(RANDOM, "the generator of the module 'random'", ""))
        if _legacy_state() != states[1]:
            found.append(Impurity(RANDOM, "the generator that 'numpy.random' shares", ""))


@contextmanager
def unnoticed() -> Iterator[None]:
    """Collect nothing until the context is left: it is no doing of the module's."""
    before = sys.getprofile()
    sys.setprofile(None)
    try:
        yield
    finally:
        sys.setprofile(before)


def _kind(function: Any) -> str | None:
    name, owner = getattr(function, "__name__", ""), getattr(function, "__self__", None)
    if isinstance(owner, type) and (owner, name) in _METHODS:
        return _METHODS[owner, name]
    return _FUNCTIONS.get((getattr(function, "__module__", None) or "", name))


def _legacy_state() -> tuple[Any, ...]:
    name, keys, *rest = np.random.get_state(legacy=True)
    return (name, np.asarray(keys).tobytes(), *rest)
