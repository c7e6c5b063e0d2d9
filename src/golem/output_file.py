"""Writes what a user asked for into a file, and makes the folder for several."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from golem.errors import OutputError


def make_folder(folder: Path) -> None:
    """Make the folder of an --out where needed. Raises OutputError: it cannot be made, read or written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot write to --out {folder}: {error.strerror}; choose another.") from error
    if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
        raise OutputError(f"Cannot write to --out {folder}: Permission denied; choose another.")


def write_file(path: Path, text: str) -> Path:
    """Write a file, and its folder, whole or not at all; return its path. Raises OutputError: it cannot be written."""
    part = Path(f"{path}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="utf-8")
        os.replace(part, path)
    except OSError as error:
        with suppress(OSError):
            part.unlink()
        raise OutputError(f"Cannot write {path}: {error.strerror}.") from error
    return path
