"""One name stands for one thing: no class name and no file name occurs twice in the package."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

from tests.sources import FILES, code, parsed

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


def given(text: str) -> list[str]:
    """Return the names that a module's text gives at its top, once for each time."""
    found = list[str]()
    for node in parsed(text).body:
        if isinstance(node, ast.Assign):
            found += [
                n.id
                for target in node.targets
                for n in ast.walk(target)
                if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
            ]
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found.append(node.target.id)
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.append(node.name)
    return found


def test_no_module_gives_a_name_twice() -> None:
    found = {str(path): twice(given(path.read_text(encoding="utf-8"))) for path in files()}
    assert {path: names for path, names in found.items() if names} == {}


def test_a_constant_that_another_one_replaces_is_found() -> None:
    assert twice(given("FEWEST = 4\ndef f(): return FEWEST\nFEWEST, SPAN = 200, 1\n")) == {"FEWEST"}
