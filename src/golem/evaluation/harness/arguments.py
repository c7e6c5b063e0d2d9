"""What words of a command line mean that several commands of evaluation take."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from golem import registry
from golem.errors import ConfigError
from golem.evaluation.base import Case
from golem.options import check_values, read_yaml
from golem.robots.worlds.conditions import CHOICES, NAMES, Value, check_condition
from golem.stack import read_choice

COUNT = 5
"""Values of a range that names no count."""
RATIO = 5.0
"""A range of positive values whose ends differ by more than this factor is divided evenly in its logarithm."""


def read_sweep(text: str) -> Sequence[Case]:
    """Return the cases that `NAME=FROM..TO`, `NAME=FROM..TO:COUNT` or `NAME=VALUE,VALUE` stands for.

    Args:
        text: nothing is one case without a condition.

    Raises:
        ConfigError: it reads otherwise, or there is no such condition or value.
    """
    if not text:
        return ({},)
    name, equals, values = text.partition("=")
    if not (equals and name and values):
        raise ConfigError(
            f"--sweep '{text}' must read NAME=FROM..TO, NAME=FROM..TO:COUNT or NAME=VALUE,VALUE; names: "
            f"{', '.join(NAMES)}."
        )
    if name in CHOICES or ".." not in values:
        found = [check_condition(name, _value(name, word)) for word in values.split(",")]
    else:
        found = _range(name, values)
    if len(set(found)) != len(found):
        raise ConfigError(f"--sweep '{text}' names a value twice.")
    return tuple({name: value} for value in found)


def _value(name: str, word: str) -> object:
    return word.strip() if name in CHOICES else read_yaml(word, f"--sweep {name}")


def _range(name: str, values: str) -> list[Value]:
    ends, _, counted = values.partition(":")
    first, _, last = ends.partition("..")
    low, high = (check_condition(name, _value(name, word)) for word in (first, last))
    count = _value(name, counted) if counted else COUNT
    if not isinstance(count, int) or not 2 <= count <= 100:
        raise ConfigError(f"--sweep {name}: the count of a range is a whole number from 2 to 100, not '{counted}'.")
    assert isinstance(low, float) and isinstance(high, float)
    steps = [k / (count - 1) for k in range(count)]
    if 0.0 < low < high and high / low > RATIO:
        return [float(f"{low * math.exp(u * math.log(high / low)):.4g}") for u in steps]
    return [float(f"{low + u * (high - low):.4g}") for u in steps]


def replaced_modules(words: Iterable[str]) -> dict[str, str]:
    """Return slot -> implementation by the words of `--use`. Raises ConfigError: one reads otherwise, or is double."""
    replaced: dict[str, str] = {}
    for word in words:
        slot, equals, implementation = word.partition("=")
        if not (slot and equals and implementation):
            raise ConfigError(f"--use '{word}' must read slot=implementation, e.g. upper_body=my_ik.py:MyIk.")
        if slot in replaced:
            raise ConfigError(f"--use names the {slot} twice.")
        replaced[slot] = implementation
    return replaced


def new_module(slot: str, use: str) -> Any:
    """Return a new module of `slot`, see `read_choice`; raises as `registry.create` does, too."""
    choice = read_choice(slot, use)
    return registry.create(slot, choice.use, choice.options)


def robot_options(words: Iterable[str]) -> dict[str, Any]:
    """Return the twin's options by `name=value` words, YAML, e.g. `payload=[1, 1]`. Raises ConfigError: one is none."""
    options: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not (name and equals):
            raise ConfigError(f"--robot '{word}' must read option=value, e.g. feet=box or payload=[1,1].")
        if name == "latency":
            raise ConfigError("The latency has an option of its own, --latency.")
        options[name] = read_yaml(value, f"--robot {name}")
        check_values(f"--robot {name}", options[name])
    return options
