"""The tools as agents see them: names, what they do, and JSON Schemas of what they take and answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from golem.agent.answers import answer_schema
from golem.agent.desk import OWN, STILL, Desk
from golem.agent.tool_rules import ToolRule
from golem.skills.spec import Schema, SkillSpec

_ASKS = {"free": "", "ask": " The operator is asked first.", "never": " The rules do not allow it."}


@dataclass(frozen=True)
class ToolSpec:
    """A tool.

    Attributes:
        name: by which it is called.
        text: what it does, and whether the operator is asked.
        takes, gives: schemas of its arguments and its answers.
        still: whether it moves nothing.
    """

    name: str
    text: str
    takes: Schema
    gives: Schema
    still: bool


def tool_specs(desk: Desk) -> list[ToolSpec]:
    """Return every tool of a desk, the fields of its goal as narrow as the rules make them."""
    done: Schema = {"type": "object", "properties": {"success": {"type": "boolean"}}, "required": ["success"]}
    own = [ToolSpec(spec.name, spec.summary, spec.goal, done, True) for spec in OWN.values()]
    return own + [_of_skill(spec, desk.rules.of(name)) for name, spec in sorted(desk.body.specs.items())]


def _of_skill(spec: SkillSpec, rule: ToolRule) -> ToolSpec:
    takes = spec.goal
    for name, allowed in rule.fields.items():
        takes = _narrowed(takes, name.split("."), allowed)
    text = f"{spec.summary}.{_ASKS[rule.run]}"
    return ToolSpec(spec.name, text, takes, answer_schema(spec.result), spec.name in STILL)


def _narrowed(schema: Schema, path: list[str], allowed: list[Any]) -> Schema:
    of = schema.get("properties", {}).get(path[0])
    if of is None:
        return schema
    narrow = (
        {"enum": allowed} if isinstance(allowed[0], str) else dict(zip(("minimum", "maximum"), allowed, strict=True))
    )
    if len(path) > 1:
        of = _narrowed(of, path[1:], allowed)
    else:
        of = of | ({"items": of["items"] | narrow} if "items" in of else narrow)
    return schema | {"properties": schema["properties"] | {path[0]: of}}
