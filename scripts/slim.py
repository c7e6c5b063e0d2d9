"""Makes an environment smaller: `python scripts/slim.py FOLDER`, the folder of its packages.

What only building C++ against it needs goes: headers, static libraries, programs; and MuJoCo's window. Wheels cannot
hold links, so a shared library comes under each of its names as a file; these become one.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
from pathlib import Path

LEAST = 50_000
"""Smallest file that is worth a link [bytes]."""


def slim(packages: Path) -> None:
    """Remove what is not run from the folder `packages`, and keep what is there twice once."""
    shutil.rmtree(packages / "mujoco" / "studio", ignore_errors=True)
    for prefix in packages.glob("cmeel.prefix"):
        for folder in ("include", "bin", "lib/cmake", "lib/pkgconfig"):
            shutil.rmtree(prefix / folder, ignore_errors=True)
        for library in prefix.rglob("*.a"):
            library.unlink()
        link_equals(prefix / "lib")


def link_equals(folder: Path) -> None:
    """Give the shared libraries in `folder` that are equal one file."""
    known: dict[bytes, Path] = {}
    for path in sorted(folder.glob("*.so*")):
        if path.is_symlink() or path.stat().st_size < LEAST:
            continue
        first = known.setdefault(hashlib.sha256(path.read_bytes()).digest(), path)
        if not first.samefile(path):
            part = path.with_suffix(".part")
            os.link(first, part)
            part.replace(path)


if __name__ == "__main__":
    slim(Path(sys.argv[1]))
