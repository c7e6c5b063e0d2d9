"""No module imports itself by way of others: each can be imported first."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter

import pytest
from tests.sources import FILES, SOURCE, parsed


def imported_at_once(body: list[ast.stmt]) -> Iterator[str]:
    """Yield what is imported when the module is; a function's imports wait, a type checker's never happen."""
    for node in body:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        if isinstance(node, ast.If | ast.Try):
            yield from imported_at_once(node.body)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (name for alias in node.names for name in (f"{node.module}.{alias.name}", node.module))


def circle(imports: Mapping[str, set[str]]) -> list[str]:
    """Return the modules of one circle, in order; none where there is no circle."""
    try:
        TopologicalSorter({name: used & imports.keys() - {name} for name, used in imports.items()}).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_imports_have_no_circle() -> None:
    texts = {
        ".".join(("golem", *path.relative_to(SOURCE).with_suffix("").parts)): path.read_text(encoding="utf-8")
        for path in FILES
        if path.name != "__init__.py"
    }
    assert circle({name: {*imported_at_once(parsed(text).body)} for name, text in texts.items()}) == []


@pytest.mark.parametrize(("b", "found"), [("import c", []), ("import a", ["a", "b", "a"])])
def test_a_circle_is_found(b: str, found: list[str]) -> None:
    imports = {"a": {*imported_at_once(parsed("from b import x").body)}, "c": set[str]()}
    imports["b"] = {*imported_at_once(parsed(b).body)}
    assert sorted(circle(imports)) == sorted(found)
