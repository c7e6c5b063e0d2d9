"""What the package's source files import and define, read once in a process, for the tests that judge code."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).resolve().parent.parent / "src" / "golem"
FILES = tuple(sorted(SOURCE.rglob("*.py")))


@dataclass(frozen=True)
class Code:
    """What one file says; anywhere in its text, not only at its top.

    Attributes:
        imports: dotted names as they are imported; a relative one begins with its dots.
        dynamic: names that are literal arguments of `import_module` and `__import__`.
        classes: names of the classes.
        lines: how many.
    """

    imports: frozenset[str]
    dynamic: frozenset[str]
    classes: tuple[str, ...]
    lines: int


def parsed(text: str) -> ast.Module:
    """Return the tree of a source.

    CPython 3.11 counts the depth of trees for all threads at once: where another one compiles meanwhile it raises
    SystemError (cpython#106905). Then it is parsed once more.
    """
    try:
        return ast.parse(text)
    except SystemError:
        return ast.parse(text)


def _imports(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        base = "." * node.level + (f"{node.module}." if node.module else "")
        yield from (f"{base}{alias.name}" for alias in node.names)


def _dynamic(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if called in ("import_module", "__import__"):
            yield str(node.args[0].value)


def parse(text: str) -> Code:
    """Return what a file with this text says."""
    nodes = list(ast.walk(parsed(text)))
    return Code(
        frozenset(each for node in nodes for each in _imports(node)),
        frozenset(each for node in nodes for each in _dynamic(node)),
        tuple(node.name for node in nodes if isinstance(node, ast.ClassDef)),
        len(text.splitlines()),
    )


@cache
def code(path: Path) -> Code:
    """Return what a source file says."""
    return parse(path.read_text(encoding="utf-8"))


def name(path: Path) -> str:
    """Return a source file as its path below the package."""
    return path.relative_to(SOURCE).as_posix()
