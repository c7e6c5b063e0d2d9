"""Imports go downward through the layers, and nothing but the evaluation sees the simulator's truth."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.sources import FILES, SOURCE, Code, code, name, parse

# From the bottom up. A package may import from its own row and from every row below it.
LAYERS = (
    (
        "__init__",
        "types",
        "errors",
        "figures",
        "kernels",
        "native",
        "native_messages",
        "finite",
        "options",
        "output_file",
        "package_data",
        "traces",
        "registry",
        "user_file",
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
    ("agent",),
    ("evaluation", "dashboard", "doctor", "option_list"),
    ("datasets", "training"),
    ("run", "demo", "demo_pack", "demo_walk", "agent_command"),
    ("teleop",),
    ("cli", "__main__"),
)
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}
NOT_AT_RUN_TIME = "training"


def top(path: Path) -> str:
    """Return the first name below `golem` that the file belongs to."""
    return path.relative_to(SOURCE).parts[0].removesuffix(".py")


def absolute(imported: str, package: tuple[str, ...]) -> list[str]:
    """Return the parts of the dotted name that a module of `package` imports."""
    parts = imported.lstrip(".").split(".")
    level = len(imported) - len(imported.lstrip("."))
    return [*package[: len(package) - level + 1], *parts] if level else parts


def violations(file: Code, package: tuple[str, ...], owner: str) -> list[str]:
    """Return the imports of a module of `package` that point above the layer of `owner`."""
    found: list[str] = []
    for parts in sorted(absolute(imported, package) for imported in file.imports):
        if parts[0] != "golem":
            continue
        target = parts[1] if len(parts) > 1 else "__init__"
        level = LEVEL.get(target, LEVEL["__init__"])
        if level > LEVEL[owner] or (target == NOT_AT_RUN_TIME != owner and owner != "cli"):
            found.append(f"{owner} imports {'.'.join(parts)}")
    return found


def test_every_package_has_a_layer() -> None:
    assert {top(path) for path in FILES} <= set(LEVEL)


def test_imports_go_downward() -> None:
    found = {
        name(path): violations(code(path), ("golem", *path.relative_to(SOURCE).parent.parts), top(path))
        for path in FILES
    }
    assert len(found) > 600
    assert {file: wrong for file, wrong in found.items() if wrong} == {}


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
    assert violations(parse(statement), ("golem", owner), owner) != []


def test_files_stay_readable() -> None:
    lengths = {name(path): code(path).lines for path in FILES if path.parent.name != "msgs"}  # generated
    assert {file: n for file, n in lengths.items() if n > 400} == {}
