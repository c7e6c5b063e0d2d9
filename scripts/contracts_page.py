"""Writes the page of the contracts: `python scripts/contracts_page.py docs/reference/contracts.md`."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "src"
SECTIONS = {
    "Grasp methods": "golem.capabilities.grasping.base",
    "Arms": "golem.capabilities.arms.base",
    "Planners": "golem.capabilities.planning.base",
    "Legs": "golem.capabilities.legs.base",
    "Gait clock": "golem.capabilities.legs.gait",
    "Mappers": "golem.capabilities.mapping.base",
    "Navigators": "golem.capabilities.navigation.base",
    "Odometries": "golem.capabilities.odometry.base",
    "Memories": "golem.capabilities.memory.base",
    "Properties of things": "golem.capabilities.properties.base",
    "Localizers": "golem.capabilities.perception.base",
    "Hand controllers": "golem.hardware.hands.base",
    "Motor servos": "golem.hardware.servo.base",
    "Base estimators": "golem.hardware.estimator.base",
    "Robots": "golem.robots.base",
    "Skills": "golem.skills.base",
    "What a skill works with": "golem.skills.context",
    "What travels between modules": "golem.interfaces.payloads",
    "Steps of a navigator, maps and scans": "golem.interfaces.nav_payloads",
    "Kinematics of the arms": "golem.capabilities.arms.arm_kinematics",
    "From a box to a place": "golem.capabilities.perception.lift",
    "DDS transport": "golem.middleware.dds.base",
    "ROS 2 nodes": "golem.middleware.ros.node",
    "Shared types": "golem.types",
}
"""Heading -> module, in the order of the page."""
INTRODUCTION = """# Contracts

This page shows what a module must offer. `python scripts/contracts_page.py docs/reference/contracts.md` writes it from
the source files: their public classes and functions with docstrings, without the code.

Implement the methods of the class that is a `Protocol`; there is nothing to inherit from. `golem check` tests a module
against its contract ([Check a module](../how-to/check-a-module.md)). The stack checks it, too: when it is built, and at
every call.
"""
Statements = list[ast.stmt]


def page() -> str:
    """Return the text of docs/reference/contracts.md."""
    return "\n".join([INTRODUCTION, *(_section(title, module) for title, module in SECTIONS.items())])


def _section(title: str, module: str) -> str:
    file = f"{module.replace('.', '/')}.py"
    text = (SOURCE / file).read_text(encoding="utf-8")
    code = ast.parse(text)
    parts = [f"## {title}", f"`src/{file}`", ast.get_docstring(code) or ""]
    for names, found in groupby(_public(code.body, text.splitlines()), key=lambda each: each[0]):
        parts += [f"### `{names}`"] if names else []
        parts += ["\n".join(["```python", *(line for _, lines in found for line in lines), "```"])]
    return "\n\n".join(parts) + "\n"


def _public(body: Statements, lines: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Yield the text of what a module documents and does not keep to itself, with the name of a class or a function."""
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            if ast.get_docstring(node) and not node.name.startswith("_"):
                yield node.name, [*_stub(node, lines)]
        elif isinstance(node, ast.Assign | ast.AnnAssign) and _is_text(after):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            if isinstance(target, ast.Name) and not target.id.startswith("_"):
                yield "", [*_lines(node, lines), *_lines(after, lines)]


def _stub(node: ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef, lines: list[str]) -> Iterator[str]:
    """Yield the lines of a class or a function as they stand, without the code of functions and what is private."""
    first, *rest = node.body
    decorators = [each.lineno for each in node.decorator_list]
    yield from lines[min([node.lineno, *decorators]) - 1 : max(first.lineno - 1, node.lineno)]
    if _is_text(first):
        yield from _lines(first, lines)
    if not isinstance(node, ast.ClassDef):
        return
    for member in node.body if not _is_text(first) else rest:
        if isinstance(member, ast.FunctionDef | ast.AsyncFunctionDef):
            if member.name == "__init__" or (ast.get_docstring(member) and not member.name.startswith("_")):
                yield ""
                yield from _stub(member, lines)
        elif isinstance(member, ast.Assign | ast.AnnAssign):
            target = member.targets[0] if isinstance(member, ast.Assign) else member.target
            if not ast.unparse(target).startswith("_"):
                yield from ([""] if member is rest[0] and _is_text(first) else [])
                yield from _lines(member, lines)
        elif _is_text(member):
            yield from _lines(member, lines)


def _lines(node: ast.stmt | None, lines: list[str]) -> list[str]:
    return lines[node.lineno - 1 : node.end_lineno] if node else []


def _is_text(node: ast.stmt | None) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
