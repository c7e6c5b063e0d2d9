"""Large blocks of memory are mapped by themselves, also after one was freed."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

MAPPED = """
import ctypes, sys
import numpy as np
from golem.runtime.live.heap import map_large_blocks

class Info(ctypes.Structure):
    _fields_ = [(name, ctypes.c_size_t) for name in "arena ordblks smblks hblks hblkhd".split() + list("abcde")]

if sys.argv[1] == "mapped":
    map_large_blocks()
mallinfo2 = ctypes.CDLL("libc.so.6").mallinfo2
mallinfo2.restype = Info
del_me = np.ones(2_000_000, np.uint8)
del del_me
before = mallinfo2().hblkhd
images = [np.ones(900_000, np.uint8) for _ in range(8)]
# By bytes, since the interpreter may free a small mapped block of its own meanwhile.
print(round((mallinfo2().hblkhd - before) / 900_000))
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's heap is set")
@pytest.mark.parametrize(("how", "count"), [("mapped", 8), ("as it is", 0)])
def test_an_image_is_mapped_by_itself(how: str, count: int) -> None:
    done = subprocess.run([sys.executable, "-c", MAPPED, how], capture_output=True, text=True, check=True)
    assert int(done.stdout) == count
