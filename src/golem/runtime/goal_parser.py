"""Reads a goal from the words of a command line, by the schema of the skill alone."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping
from typing import Annotated, Any, Literal, Optional

import tyro

from golem.errors import ConfigError
from golem.options import convert
from golem.skills.spec import Schema, SkillSpec, plain, read_goal

_SCALARS: dict[str, type[Any]] = {"boolean": bool, "integer": int, "number": float, "string": str}
HELP = ("-h", "--help")


def parse_goal(spec: SkillSpec, words: list[str], prog: str, taken: Collection[str] = ()) -> dict[str, Any]:
    """Return the fields of the goal that `words` say; a mistake in them is said, and ends the program.

    As in a call of Python, the first words may be values in the order of the fields, before others follow by name:
    `1 -0.5 --frame odom`. Raises ConfigError: a field is called as an option of the command.

    Args:
        words: the rest of the command line.
        prog: what stands before them, for the help.
        taken: options that the command itself has.
    """
    properties: dict[str, Schema] = spec.goal["properties"]
    for name in properties:
        if name in taken:
            raise ConfigError(f"The goal's field '{name}' of the skill '{spec.name}' is an option of {prog} itself.")
    kind = _dataclass(spec.name, {**spec.goal, "description": spec.summary})
    return plain(tyro.cli(kind, prog=prog, args=_named(words, properties)))


def read_fields(spec: SkillSpec, fields: Mapping[str, object]) -> dict[str, Any]:
    """Return all fields of a goal of a skill that are said by whomever, with its defaults.

    Raises ConfigError: one does not exist, is missing, has the wrong type, or is out of its range or far too much.
    """
    goal = plain(read_goal(spec.name, _dataclass(spec.name, spec.goal), fields))
    for name, of in spec.goal["properties"].items():
        value, shut = goal[name], of.get("exclusiveMinimum")
        low, high = of.get("minimum", shut), of.get("maximum", math.inf)
        if low is not None or high < math.inf:
            low = -math.inf if low is None else low
            if not low <= value <= high or value == shut:
                raise ConfigError(f"The {name} of {spec.name} lies between {low:g} and {high:g}; {value:g} does not.")
    return goal


def _named(words: list[str], properties: dict[str, Schema]) -> list[str]:
    """Return `words` with a name before each value that stands for a field by its place."""
    named: list[str] = []
    fields = ((name, of) for name, of in properties.items() if "enum" in of or of.get("type") in _SCALARS)
    for i, word in enumerate(words):
        field = next(fields, None)
        if word.startswith("--") or word in HELP or field is None or field[1].get("type") == "boolean":
            return named + words[i:]
        named.append(f"--{field[0].replace('_', '-')}={word}")
    return named


def _dataclass(name: str, schema: Schema) -> type[Any]:
    rows: list[tuple[str, Any, Any]] = []
    # Those without default come first, which a dataclass demands.
    for key, of in sorted(schema["properties"].items(), key=lambda item: "default" in item[1]):
        hint, row = _hint(key, of), dataclasses.field()
        if "default" in of:
            default = convert(f"default of {key}", hint, of["default"])
            row = dataclasses.field(default_factory=lambda default=default: default)
        if "description" in of and of.get("type") != "object":
            hint = Annotated[hint, tyro.conf.arg(help=of["description"])]
        rows.append((key, hint, row))
    made = dataclasses.make_dataclass(name, rows)
    made.__doc__ = schema.get("description") or name
    return made


def _hint(name: str, of: Schema) -> Any:
    if "enum" in of:
        return Literal[tuple(of["enum"])]
    if "anyOf" in of:
        return Optional[_hint(name, of["anyOf"][0])]  # noqa: UP045  a hint made at run time
    if "prefixItems" in of:
        return tuple[tuple(_hint(name, each) for each in of["prefixItems"])]
    if of["type"] == "array":
        return tuple[_hint(name, of["items"]), ...]
    return _dataclass(name, of) if of["type"] == "object" else _SCALARS[of["type"]]
