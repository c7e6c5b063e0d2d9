"""Every public method says what it does, or is one of a class or contract of the package that does."""

from __future__ import annotations

import ast
import re
from collections import defaultdict

from tests.sources import SOURCE, parsed

Methods = dict[str, bool]
"""Name of a method -> whether it has a docstring."""


def test_public_methods_say_what_they_do_or_inherit_it() -> None:
    own, bases, found = defaultdict[str, Methods](dict), defaultdict[str, set[str]](set), list[tuple[str, str, str]]()
    for path in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(parsed(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                bases[node.name] |= {name for base in node.bases if (name := _name(base))}
                # The contracts that it keeps, too.
                bases[node.name] |= set(re.findall(r"`(?:\w+\.)*(\w+)`", ast.get_docstring(node) or ""))
                for member in node.body:
                    if isinstance(member, ast.FunctionDef | ast.AsyncFunctionDef):
                        own[node.name][member.name] = ast.get_docstring(member) is not None
                        found.append((str(path.relative_to(SOURCE)), node.name, member.name))

    def says(kind: str, method: str, seen: frozenset[str] = frozenset()) -> bool:
        if own[kind].get(method):
            return True
        return any(says(base, method, seen | {kind}) for base in bases[kind] - seen)

    public = [(file, kind, name) for file, kind, name in found if not kind.startswith("_") and not name.startswith("_")]
    silent = [f"{file}: {kind}.{name}" for file, kind, name in public if not says(kind, name)]
    assert len(public) > 1000
    assert silent == []


def _name(base: ast.expr) -> str:
    """Return the last word of a base class as it is written, without its type arguments."""
    base = base.value if isinstance(base, ast.Subscript) else base
    return base.attr if isinstance(base, ast.Attribute) else base.id if isinstance(base, ast.Name) else ""
