"""Imports go downward through the layers, and nothing but the evaluation sees the simulator's truth."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parent.parent / "src" / "golem"

# From the bottom up. A package may import from its own row and from every row below it.
LAYERS = (
    (
        "__init__",
        "types",
        "errors",
        "figures",
        "finite",
        "options",
        "traces",
        "registry",
        "slots",
        "true_runs",
    ),
    ("middleware",),
    ("interfaces",),
    ("robots",),
    ("hardware",),
    ("capabilities",),
    ("skills",),
    ("stack", "runtime", "provenance"),
    ("evaluation", "training", "dashboard", "doctor", "option_list"),
    ("run", "demo", "demo_walk", "cli", "__main__"),
)
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}
NOT_AT_RUN_TIME = "training"


def top(path: Path) -> str:
    """Return the first name below `golem` that the file belongs to."""
    return path.relative_to(SOURCE).parts[0].removesuffix(".py")


def imported(source: str, package: tuple[str, ...]) -> set[str]:
    """Return the dotted `golem` names that `source`, a module of `package`, imports anywhere in its text."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(part for part in (base, node.module) if part)
            names.update(f"{module}.{alias.name}" for alias in node.names)
    return {name for name in names if name.split(".")[0] == "golem"}


def violations(source: str, package: tuple[str, ...], owner: str) -> list[str]:
    """Return the imports in `source` that point above the layer of `owner`."""
    found: list[str] = []
    for name in sorted(imported(source, package)):
        parts = name.split(".")
        target = parts[1] if len(parts) > 1 else "__init__"
        level = LEVEL.get(target, LEVEL["__init__"])
        if level > LEVEL[owner] or (target == NOT_AT_RUN_TIME != owner and owner != "cli"):
            found.append(f"{owner} imports {name}")
    return found


FILES = sorted(SOURCE.rglob("*.py"))


def test_every_package_has_a_layer() -> None:
    assert {top(path) for path in FILES} <= set(LEVEL)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_imports_go_downward(path: Path) -> None:
    package = ("golem", *path.relative_to(SOURCE).parent.parts)
    assert violations(path.read_text(encoding="utf-8"), package, top(path)) == []


@pytest.mark.parametrize(
    ("statement", "owner"),
    [
        ("from golem.skills import grasping", "hardware"),
        ("import golem.evaluation.episodes.oracle", "skills"),
        ("from ..evaluation import oracle", "capabilities"),
        ("def f():\n    from golem import cli", "evaluation"),
        ("from golem.training.detector import renders", "evaluation"),
    ],
)
def test_an_upward_import_is_found(statement: str, owner: str) -> None:
    assert violations(statement, ("golem", owner), owner) != []


def test_files_stay_readable() -> None:
    lengths = {
        str(path.relative_to(SOURCE)): len(path.read_text(encoding="utf-8").splitlines())
        for path in FILES
        if path.parent.name != "msgs"  # generated
    }
    assert {name: n for name, n in lengths.items() if n > 400} == {}
