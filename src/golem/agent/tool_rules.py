"""What tools may do: which run freely, which ask the operator, and within what region, speed, force and count."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from golem.errors import ConfigError
from golem.options import check_values, convert, read_yaml, require
from golem.types import Array

Run = Literal["free", "ask", "never"]
"""free: at once. ask: the operator says yes or no, each time. never: refused."""
FREE = ("stop", "look", "read")
"""Tools that are no skills: free without a rule of their own, and `stop` always."""
Span = tuple[float, float]
STOPPING = 0.5
"""Time in which a robot that is told to stand stops [s]: it is told that long before it would leave the region."""


@dataclass(frozen=True)
class ToolRule:
    """What one tool may do.

    Attributes:
        run: whether it runs freely, asks, or never runs.
        count: how often it may run, until the server ends; None: as often as it likes.
        fields: what fields of its goal may be, by their names, `pick.label` for one inside another: two numbers are the
            least and the most, words are those that are allowed.
    """

    run: Run = "ask"
    count: int | None = None
    fields: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def __post_init__(self) -> None:
        require("rule of a tool: ", ("count", self.count or 0, (self.count or 0) >= 0, "not negative"))
        for name, allowed in self.fields.items():
            numbers = isinstance(allowed, list) and len(allowed) == 2 and all(map(is_number, allowed))
            words = isinstance(allowed, list) and all(isinstance(each, str) for each in allowed)
            if not numbers and not words:
                raise ConfigError(f"The field '{name}' of a rule has two numbers, or a list of words, not {allowed!r}.")


@dataclass(frozen=True)
class Region:
    """Where on the floor base_link may be, and where things may be put: least and most x and y, in odom [m]."""

    x: Span
    y: Span

    def __post_init__(self) -> None:
        for name, (low, high) in (("x", self.x), ("y", self.y)):
            require("region's ", (f"least {name}", low, low < high, f"less than its most, {high:g}"))

    def holds(self, x: float, y: float) -> bool:
        """Return whether a place in odom is inside [m]."""
        return self.x[0] <= x <= self.x[1] and self.y[0] <= y <= self.y[1]


@dataclass(frozen=True)
class Rules:
    """What all tools may do.

    Attributes:
        default: how a tool without a rule of its own runs.
        region: where the robot may be; None: anywhere.
        speed: of base_link over the floor above which a skill is cancelled [m/s].
        force: of a hand on the world, beyond what it had when the skill began, above which it is cancelled [N].
        calls: a second that are answered; more are refused.
        patience: how long the operator has to answer [s]; then it is no.
        lease: how long a client without a call keeps others from moving the robot [s].
    """

    default: Run = "ask"
    tools: Mapping[str, ToolRule] = field(default_factory=lambda: {"recall": ToolRule("free")})
    region: Region | None = None
    speed: float = math.inf
    force: float = math.inf
    calls: int = 20
    patience: float = 60.0
    lease: float = 60.0

    def __post_init__(self) -> None:
        positive = (("speed", self.speed), ("force", self.force), ("calls", self.calls), ("patience", self.patience))
        require("rule ", *((name, value, value > 0.0, "positive") for name, value in positive))

    def of(self, tool: str) -> ToolRule:
        """Return the rule of a tool."""
        return self.tools.get(tool) or ToolRule("free" if tool in FREE else self.default)

    def problem(self, tool: str, goal: Mapping[str, Any], places: list[tuple[float, float]]) -> str:
        """Return why a goal is not allowed; empty where it is.

        Args:
            goal: all its fields, with their defaults.
            places: x, y in odom of where it sends the robot or what it holds [m].
        """
        for name, allowed in self.of(tool).fields.items():
            for value in _values(goal, name.split(".")):
                if isinstance(allowed[0] if allowed else "", str):
                    if value not in allowed:
                        return f"'{name}' is one of {', '.join(map(str, allowed))}."
                elif not is_number(value) or not allowed[0] <= value <= allowed[1]:
                    return f"'{name}' is from {allowed[0]:g} to {allowed[1]:g}."
        for x, y in places if self.region is not None else ():
            if self.region is not None and not self.region.holds(x, y):
                return f"({x:.2f}, {y:.2f}) is outside of the region."
        return ""

    def excess(self, x: float, y: float, velocity: Array, force: float) -> str:
        """Return why a motion may not go on; empty where it may.

        Args:
            x: of base_link in odom [m].
            y: likewise.
            velocity: (2,) of base_link in odom [m/s].
            force: the larger one of both hands, beyond what it was at first [N].
        """
        if not math.isfinite(x + y + math.hypot(*velocity) + force):
            return "Where the robot is, or how it moves, is not known."
        if self.region is not None:
            inside = self.region.holds(x, y)
            ahead = x + STOPPING * velocity[0], y + STOPPING * velocity[1]
            if not self.region.holds(*ahead) and (inside or math.hypot(*velocity) > 0.05):
                return "The robot is about to leave the region that the rules allow."
        if math.hypot(*velocity) > self.speed:
            return f"The robot is faster than {self.speed:g} m/s."
        return f"A hand presses with {force:.0f} N." if force > self.force else ""


def is_number(value: object) -> bool:
    """Return whether a value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _values(goal: Any, path: list[str]) -> Iterator[Any]:
    """Yield what is at `path` in a goal, each member of a list."""
    for name in path:
        goal = goal.get(name) if isinstance(goal, Mapping) else None
    yield from goal if isinstance(goal, list | tuple) else (goal,)


def load_rules(file: Path | None) -> Rules:
    """Return the rules in a YAML file, else the default ones. Raises ConfigError: unreadable, or makes no sense."""
    if file is None:
        return Rules()
    try:
        said = read_yaml(file.read_text(encoding="utf-8"), file.name)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"The rules '{file}' cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    if not isinstance(said, dict):
        raise ConfigError(f"{file.name}: rules are a mapping, such as 'default: ask'.")
    check_values(file.name, said)
    tools = said.get("tools", {})
    if not isinstance(tools, dict):
        raise ConfigError(f"{file.name}: 'tools' is a mapping of names to rules.")
    rest = {name: value for name, value in said.items() if name != "tools"}
    rules: Rules = convert(f"rule in {file.name}", Rules, rest)
    own = {name: convert(f"rule of {name}", ToolRule, rule) for name, rule in tools.items()}
    return replace(rules, tools={**rules.tools, **own})
