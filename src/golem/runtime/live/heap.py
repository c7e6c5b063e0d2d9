"""The heap of a process that runs for days and holds images for a moment each."""

from __future__ import annotations

import ctypes
from contextlib import suppress

LARGE = 1 << 16
"""Size from which a block of memory is mapped by itself [bytes]: an image's arrays, and clouds."""
_M_MMAP_THRESHOLD = -3
"""Parameter of glibc's mallopt (malloc.h)."""


def map_large_blocks() -> None:
    """Have blocks of `LARGE` or more mapped each by itself, unless a hole fits, and given back when freed; glibc only.

    Without this glibc raises the bound to the largest block that was freed so far, up to 32 MB. Images then lie
    between small objects, whose holes stay: the stack process grew by 4 to 10 MB a pick.
    """
    with suppress(OSError, AttributeError):
        ctypes.CDLL("libc.so.6").mallopt(_M_MMAP_THRESHOLD, LARGE)
