"""Where in a user's file something went wrong: the frames that are theirs, each as `path:line`."""

from __future__ import annotations

import sysconfig
import traceback
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

_PACKAGE = str(Path(__file__).parent)
_LIBRARIES = tuple({sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")})
_MACHINERY = tuple(f"{_PACKAGE}/{name}" for name in ("runtime/", "evaluation/", "registry.py", "skills/runner.py"))
"""What calls modules, and is none of them."""
DEEPEST = 8
"""Frames that a trace shows, the innermost; a recursion without end has a thousand."""

Frames = Iterable[tuple[FrameType, int]]
"""Frames with the line each is at, the outermost first."""


@dataclass(frozen=True, slots=True)
class Trace:
    """Where something was raised.

    Attributes:
        where: innermost line of the module, `my_arms.py:12`; empty where no line of it was running.
        text: its frames as Python prints them, and what was raised; None where no line of it was running.
    """

    where: str = ""
    text: str | None = None


def trace_of(error: BaseException) -> Trace:
    """Return where `error`, which was just caught, was raised."""
    raised = traceback.format_exception_only(error)
    if isinstance(error, SyntaxError) and is_users(error.filename or "<"):  # no line of it runs
        return Trace(text="".join(raised).rstrip())
    if not (frames := own_frames(traceback.walk_tb(error.__traceback__))):
        return Trace()
    lines = traceback.StackSummary.extract(iter(frames[-DEEPEST:])).format()
    return Trace(place(frames), "".join(["Traceback (most recent call last):\n", *lines, *raised]).rstrip())


def own_frames(frames: Frames) -> list[tuple[FrameType, int]]:
    """Return those of `frames` that belong to a module: of the user's files, else of this package's modules."""
    found = [(frame, line, _owner(frame.f_code.co_filename)) for frame, line in frames]
    owners = {owner for *_, owner in found}
    wanted = next((owner for owner in ("user", "module", "library") if owner in owners), None)
    return [(frame, line) for frame, line, owner in found if owner == wanted]


def place(frames: list[tuple[FrameType, int]]) -> str:
    """Return the innermost line of `frames` as `my_arms.py:12`; empty where there is none."""
    return f"{Path(frames[-1][0].f_code.co_filename).name}:{frames[-1][1]}" if frames else ""


def describe(error: BaseException) -> str:
    """Return what was raised, in one line."""
    return ": ".join(filter(None, (type(error).__name__, " ".join(str(error).split()))))


def _owner(path: str) -> str:
    """Return whose file `path` is: the user's, one of this package's modules', or a library's."""
    if path.startswith(_PACKAGE):
        return "machinery" if path.startswith(_MACHINERY) else "module"
    return "library" if path.startswith(("<", *_LIBRARIES)) else "user"


def is_users(path: str) -> bool:
    """Return whether a file belongs to neither this package nor a library."""
    return _owner(path) == "user"


def caller(frame: FrameType) -> str | None:
    """Return the line of the module in which `frame` or the nearest frame outside the libraries is.

    None where that is no module's: the machinery, or nobody's.
    """
    at: FrameType | None = frame
    while at is not None:
        owner = _owner(at.f_code.co_filename)
        if owner != "library":
            return place([(at, at.f_lineno)]) if owner != "machinery" else None
        at = at.f_back
    return None
