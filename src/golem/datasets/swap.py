"""Changes a folder whole or not at all: the new one is made beside it of hard links, and takes its place at once."""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from golem.errors import OutputError

_HERE, _SWAP = -100, 2
"""AT_FDCWD; RENAME_EXCHANGE of Linux and RENAME_SWAP of macOS, which have the same value."""
_UNABLE = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)


@contextmanager
def held(root: Path) -> Iterator[None]:
    """Keep other writers away from the folder `root`, and clear away what a writer that was killed left beside it.

    Raises OutputError: another writer has it, or the place cannot be written.
    """
    try:
        root.parent.mkdir(parents=True, exist_ok=True)
        lock = beside(root, "lock").open("w")
    except OSError as error:
        raise OutputError(f"Cannot write {root}: {error.strerror}.") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise OutputError(f"Another process writes {root}; wait until it ends.") from error
        if not root.exists() and beside(root, "old").exists():  # killed between the two steps of a slow swap
            os.rename(beside(root, "old"), root)
        for name in ("new", "old", "episode"):
            shutil.rmtree(beside(root, name), ignore_errors=True)
        yield


def beside(root: Path, name: str) -> Path:
    """Return what is hidden beside the folder `root` and serves for `name`."""
    return root.parent / f".{root.name}.{name}"


@contextmanager
def replaced(root: Path) -> Iterator[Path]:
    """Yield an empty folder that replaces `root` once all is well. Raises OutputError: something cannot be written."""
    new = beside(root, "new")
    try:
        new.mkdir(parents=True)
        yield new
        for folder, _, files in os.walk(new):
            for path in (*(Path(folder, name) for name in files), Path(folder)):
                sync(path)
        _exchange(new, root)
        sync(root.parent)
    except OSError as error:
        raise OutputError(f"Cannot write {root}: {error.strerror or error}; what was there is unchanged.") from error
    finally:
        shutil.rmtree(new, ignore_errors=True)


def link(source: Path, target: Path) -> None:
    """Let `target` be the same file as `source`; a copy where the file system has no links."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, target)
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise
        shutil.copy2(source, target)


def sync(path: Path) -> None:
    """Bring a file or folder to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _exchange(new: Path, root: Path) -> None:
    """Exchange two folders in one step, or, where the system has none, in two; `held` mends what ends between them."""
    if not root.exists():
        os.rename(new, root)
        return
    libc, (a, b) = ctypes.CDLL(None, use_errno=True), (os.fsencode(new), os.fsencode(root))
    if hasattr(libc, "renameat2") or sys.platform == "darwin":
        mac = sys.platform == "darwin"
        if not (libc.renamex_np(a, b, _SWAP) if mac else libc.renameat2(_HERE, a, _HERE, b, _SWAP)):
            return
        if (code := ctypes.get_errno()) not in _UNABLE:
            raise OSError(code, os.strerror(code))
    old = beside(root, "old")
    os.rename(root, old)
    os.rename(new, root)
    shutil.rmtree(old, ignore_errors=True)
