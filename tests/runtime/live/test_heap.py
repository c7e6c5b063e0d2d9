"""Large blocks of memory are mapped by themselves, also after one was freed."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

MAPPED = """
import ctypes, sys
import numpy as np
from golem.runtime.live.process import map_large_blocks

class Info(ctypes.Structure):
    _fields_ = [(name, ctypes.c_size_t) for name in "arena ordblks smblks hblks hblkhd".split() + list("abcde")]

if sys.argv[1] == "mapped":
    map_large_blocks()
mallinfo2 = ctypes.CDLL("libc.so.6").mallinfo2
mallinfo2.restype = Info
del_me = np.ones(2_000_000, np.uint8)
del del_me
before = mallinfo2().hblks
images = [np.ones(900_000, np.uint8) for _ in range(20)]
print(mallinfo2().hblks - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's heap is set")
@pytest.mark.parametrize(("how", "count"), [("mapped", range(18, 21)), ("as it is", range(1))])
def test_an_image_is_mapped_by_itself(how: str, count: range) -> None:
    """But for one or two that fill holes which the imports have left in the heap."""
    done = subprocess.run([sys.executable, "-c", MAPPED, how], capture_output=True, text=True, check=True)
    assert int(done.stdout) in count
