"""Writes what a user asked for into a file."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from golem.errors import OutputError


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
