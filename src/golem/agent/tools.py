"""The tools as agents see them: names, what they do, and JSON Schemas of what they take and answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from golem.agent.answers import WORDS, answer_schema
from golem.agent.body import CAMERAS, RESOURCES
from golem.agent.desk import STILL, Desk
from golem.agent.rules import ToolRule
from golem.skills.spec import Schema, SkillSpec

_ASKS = {"free": "", "ask": " The operator is asked first.", "never": " The rules do not allow it."}
_FOUND: Schema = {
    "type": "object",
    "properties": {
        "label": WORDS,
        "score": {"type": "number"},
        "position": {"type": "array", "items": {"type": "number"}, "description": "x, y, z in odom [m]"},
    },
}
_OWN: dict[str, tuple[str, Schema, Schema]] = {
    "stop": (
        "Cancel what the robot does, at once, whoever began it",
        {"motors": {"type": "boolean", "default": False, "description": "whether the safety gate stops it, too"}},
        answer_schema({}),
    ),
    "look": (
        "Look with a camera: a picture, and where what you name is seen in it",
        {
            "camera": {"enum": list(CAMERAS), "default": "head"},
            "labels": {
                "type": "array",
                "items": {"type": "string"},
                "default": [],
                "description": "kinds of things to look for, such as mug; none: the picture alone",
            },
        },
        {"type": "object", "properties": {"success": {"type": "boolean"}, "found": {"type": "array", "items": _FOUND}}},
    ),
    "read": (
        "Read what the robot knows: " + " ".join(f"{name}: {text}" for name, text in RESOURCES.items()),
        {"resource": {"enum": list(RESOURCES)}},
        {"type": "object", "properties": {"success": {"type": "boolean"}}},
    ),
}


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
    found: list[ToolSpec] = []
    for name, (text, properties, gives) in _OWN.items():
        required = [key for key, of in properties.items() if "default" not in of]
        takes = {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
        found.append(ToolSpec(name, f"{text}.", takes, gives, True))
    return found + [_of_skill(spec, desk.rules.of(name)) for name, spec in sorted(desk.body.specs.items())]


def _of_skill(spec: SkillSpec, rule: ToolRule) -> ToolSpec:
    takes: dict[str, Any] = spec.goal
    for name, allowed in rule.fields.items():
        takes = _narrowed(takes, name.split("."), allowed)
    text = f"{spec.summary}.{_ASKS[rule.run]}"
    return ToolSpec(spec.name, text, takes, answer_schema(spec.result), spec.name in STILL)


def _narrowed(schema: Schema, path: list[str], allowed: list[Any]) -> Schema:
    of = schema.get("properties", {}).get(path[0])
    if of is None:
        return schema
    if len(path) > 1:
        of = _narrowed(of, path[1:], allowed)
    elif not allowed or isinstance(allowed[0], str):
        inner = of.get("items")
        of = of | ({"items": inner | {"enum": allowed}} if inner else {"enum": allowed})
    else:
        of = of | {"minimum": allowed[0], "maximum": allowed[1]}
    return schema | {"properties": schema["properties"] | {path[0]: of}}
