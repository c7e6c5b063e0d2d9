"""What others may know of a skill: its name and what its goals consist of, as JSON Schema.

It travels, and command lines and forms are made of it: whoever gives a goal need not have the skill's class.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, cast

from golem.errors import ConfigError, GolemError, ModuleFault, shorten
from golem.options import fill, notes

K = TypeVar("K")
Schema = dict[str, Any]
"""A JSON Schema (draft 2020-12), of the keywords used here and no others."""
_SCALARS = {bool: "boolean", int: "integer", float: "number", str: "string", Path: "string"}
MAX_TEXT = 1000
"""Characters of a word in a goal [own: a query to a memory is a sentence or two]."""
MAX_ITEMS = 1000
"""Members of a list in a goal [own]."""
MAX_DEPTH = 8
"""Lists and mappings inside one another in a goal [own]."""


@dataclass(frozen=True)
class SkillSpec:
    """A skill that a stack offers.

    Attributes:
        name: by which the stack calls it.
        use: its implementation, as the stack file names it.
        summary: what it does, in a line.
        goal: schema of its goals, with the ranges that they accept.
        result: schema of what it finds out; empty where it does not say.
    """

    name: str
    use: str
    summary: str
    goal: Schema
    result: Schema = field(default_factory=Schema)


def schema_of(kind: Any) -> Schema:
    """Return the schema of the dataclass `kind`. Raises TypeError: it is none, or has a field that no goal can have."""
    if not (inspect.isclass(kind) and dataclasses.is_dataclass(kind)):
        raise TypeError(f"{getattr(kind, '__name__', kind)!s} is no dataclass")
    hints, texts = typing.get_type_hints(kind), notes(_doc(kind))
    properties: dict[str, Schema] = {}
    required: list[str] = []
    for row in dataclasses.fields(kind):
        properties[row.name] = of = _of_hint(f"{kind.__name__}.{row.name}", hints[row.name])
        if row.name in texts:
            of["description"] = texts[row.name]
        if row.default is not dataclasses.MISSING:
            of["default"] = plain(row.default)
        elif row.default_factory is not dataclasses.MISSING:
            of["default"] = plain(row.default_factory())
        else:
            required.append(row.name)
    return {
        "type": "object",
        "description": summary(kind),
        "properties": properties,
        "required": required,
        "additionalProperties": False,
    }


def _of_hint(where: str, hint: Any) -> Schema:
    if hint in _SCALARS:
        return {"type": _SCALARS[hint]}
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Literal:
        return {"enum": list(inner)}
    if origin in (types.UnionType, typing.Union) and len(inner) == 2 and inner[1] is type(None):
        return {"anyOf": [_of_hint(where, inner[0]), {"type": "null"}]}
    if origin in (tuple, list) and (origin is list or inner[-1] is ...):
        return {"type": "array", "items": _of_hint(where, inner[0])}
    if origin is tuple:
        items = [_of_hint(where, each) for each in inner]
        return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
    if inspect.isclass(hint) and dataclasses.is_dataclass(hint):
        return schema_of(hint)
    raise TypeError(f"{where} is of type {hint}, which cannot be written as JSON")


BEYOND = 1e9
"""A number that no goal means; one that is accepted has no bound [own]."""


def with_ranges(kind: type[Any], schema: Schema) -> Schema:
    """Return `schema`, of the goals of `kind`, with the range that each number has while the others are as by default.

    They are asked of the class itself: bisected between a number that it accepts and one that it refuses.
    """
    sample = {name: _sample(of) for name, of in schema["properties"].items() if "default" not in of}
    properties = dict(schema["properties"])
    for name, of in properties.items():
        number = of.get("type") in ("integer", "number")
        start = of.get("default", sample.get(name))

        def accepts(value: float, name: str = name) -> bool:
            try:
                kind(**{**sample, name: value})
            except Exception:  # a user's class may raise anything
                return False
            return True

        if number and accepts(start):
            whole, found = of["type"] == "integer", dict(of)
            for word, sign in (("Minimum", -1), ("Maximum", 1)):
                end = _bound(accepts, start, sign * (int(BEYOND) if whole else BEYOND), whole)
                if end is not None:
                    found[word.lower() if accepts(end) else f"exclusive{word}"] = end
            properties[name] = found
    return schema | {"properties": properties}


def _bound(accepts: Callable[[float], bool], good: float, bad: float, whole: bool) -> float | None:
    """Return the last number from `good` on towards `bad` that is accepted; None where `bad` is."""
    if accepts(bad):
        return None
    for _ in range(80):
        middle = (good + bad) // 2 if whole else 0.5 * (good + bad)
        if middle in (good, bad):
            break
        good, bad = (middle, bad) if accepts(middle) else (good, middle)
    return good if whole else round(good, 9)


def _sample(of: Schema) -> Any:
    """Return a value of what has no default, for `with_ranges`."""
    if "enum" in of:
        return of["enum"][0]
    if "prefixItems" in of:
        return tuple(_sample(each) for each in of["prefixItems"])
    return {"boolean": False, "integer": 1, "number": 0.0, "string": "a", "array": ("a",)}.get(str(of.get("type")))


def plain(value: Any) -> Any:
    """Return `value`, a dataclass or what one is made of, as JSON has it."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {row.name: plain(getattr(value, row.name)) for row in dataclasses.fields(value)}
    if isinstance(value, list | tuple):
        return [plain(each) for each in cast("list[Any]", value)]
    return str(value) if isinstance(value, Path) else value


def read_goal(name: str, kind: type[K], fields: Mapping[str, object]) -> K:
    """Return the goal, a `kind`, of the skill `name` that `fields` say, by whomever they were sent.

    Raises:
        ConfigError: a field does not exist, has the wrong type or no default, or the goal makes no sense.
        ModuleFault: its class raised something else.
    """
    for key, value in fields.items():
        _check(f"goal field of {name} '{shorten(key)}'", value)
    try:
        return fill(f"goal field of {name}", kind, fields)
    except GolemError:
        raise
    except Exception as error:  # a user's class may raise anything
        raise ModuleFault("skill", name, f"its goal raised {type(error).__name__}: {error}") from error


def as_goal(name: str, kind: type[K], goal: object) -> K:
    """Return `goal`, a `kind` or the fields of one, as a goal of the skill `name`.

    Raises:
        ConfigError: it is neither, holds a number that is not finite or far too much, or makes no sense.
        ModuleFault: its class raised something else.
    """
    if isinstance(goal, Mapping):
        return read_goal(name, kind, cast("Mapping[str, object]", goal))
    if not isinstance(goal, kind):
        raise ConfigError(f"The skill '{name}' takes a {kind.__name__}, not a {type(goal).__name__}.")
    for key, value in plain(goal).items():
        _check(f"goal field of {name} '{key}'", value)
    return goal


def _check(what: str, value: Any, depth: int = 0) -> None:
    """Check that `value` is finite and of a sensible size: it may be a stranger's, in the process that balances."""
    if isinstance(value, str):
        if len(value) > MAX_TEXT:
            raise ConfigError(f"The {what} has {len(value)} characters; at most {MAX_TEXT} are read.")
        if not value.isascii() and value != value.encode("utf-8", "replace").decode():
            raise ConfigError(f"The {what} is no text that can be written as UTF-8.")
    elif isinstance(value, int | float):
        if not abs(value) < (2**63 if isinstance(value, int) else math.inf):
            raise ConfigError(f"The {what} is a finite number.")
    elif isinstance(value, list | tuple | Mapping):
        members = cast("list[Any] | Mapping[str, Any]", value)
        if len(members) > MAX_ITEMS or depth >= MAX_DEPTH:
            raise ConfigError(f"The {what} is larger than {MAX_ITEMS} members or {MAX_DEPTH} lists in one another.")
        for each in members.values() if isinstance(members, Mapping) else members:
            _check(what, each, depth + 1)


def summary(kind: type[Any]) -> str:
    """Return the first line of a class's own docstring, without the full stop; empty where it has none."""
    return _doc(kind).partition("\n")[0].removesuffix(".")


def _doc(kind: type[Any]) -> str:
    """Return what somebody wrote about a class; a dataclass without a docstring is given its signature as one."""
    text = inspect.cleandoc(vars(kind).get("__doc__") or "")
    return "" if text.startswith(f"{kind.__name__}(") else text
