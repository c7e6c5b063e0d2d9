"""What words of a command line mean that several commands of evaluation take."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from golem.errors import ConfigError
from golem.options import check_values, read_yaml


def replaced_modules(words: Iterable[str]) -> dict[str, str]:
    """Return slot -> implementation that `slot=implementation` words of `--use` give.

    Raises:
        ConfigError: a word reads otherwise, or two name the same slot.
    """
    replaced: dict[str, str] = {}
    for word in words:
        slot, equals, implementation = word.partition("=")
        if not (slot and equals and implementation):
            raise ConfigError(f"--use '{word}' must read slot=implementation, e.g. upper_body=my_ik.py:MyIk.")
        if slot in replaced:
            raise ConfigError(f"--use names the {slot} twice.")
        replaced[slot] = implementation
    return replaced


def robot_options(words: Iterable[str]) -> dict[str, Any]:
    """Return the twin's options that `name=value` words give; values are YAML, e.g. `payload=[1, 1]`.

    Raises:
        ConfigError: a word is no option.
    """
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
