"""One name stands for one thing: no class name and no file name occurs twice in the package."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from tests.sources import FILES, code

MESSAGES = "msgs"
"""Folder of the generated ROS messages, whose names are those of their packages."""
MAY_REPEAT = {"__init__.py", "__main__.py", "base.py", "config.py"}
"""File names that say what a file is to its folder."""


def files() -> list[Path]:
    """Return every source file but the generated ones."""
    return [path for path in FILES if MESSAGES not in path.parts]


def twice(names: list[str]) -> set[str]:
    """Return the names that occur more than once."""
    return {name for name, count in Counter(names).items() if count > 1}


def test_no_class_name_occurs_twice() -> None:
    classes = [name for path in files() for name in code(path).classes if not name.startswith("_")]
    assert len(classes) > 300
    assert twice(classes) == set()


def test_no_file_name_occurs_twice() -> None:
    names = [path.name for path in files() if path.name not in MAY_REPEAT]
    assert len(names) > 250
    assert twice(names) == set()
