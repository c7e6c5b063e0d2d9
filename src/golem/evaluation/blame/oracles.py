"""What can be exchanged for truth, oracle by oracle: the table is `oracles.yaml`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from golem import registry
from golem.errors import ConfigError, check_known
from golem.package_data import load_data
from golem.robots.mujoco.config import WITH_PACK
from golem.robots.sensors.profiles import load_profile
from golem.runtime.node_groups import hears_lidar
from golem.slots import KEYS
from golem.stack import Choice, Stack

ALTERED = "golem.evaluation.blame.altered_twin:AlteredTwin"
STANDS, HANGS, HEARS, PACK = "stands", "hangs", "listens to its LiDAR", "works on a pack"


class NotHere(ConfigError):
    """An oracle has nothing to exchange in a stack."""


@dataclass(frozen=True, slots=True)
class Exchange:
    """One oracle.

    Attributes:
        words: what takes its place.
        parts: of the realism profile that become those of `ideal`.
        choices: key of the stack file -> implementation.
        twin: options of the altered twin.
        only: what a robot does that has it, `STANDS` to `PACK`; empty is all.
    """

    words: str
    parts: Sequence[str] = ()
    choices: Mapping[str, str] = field(default_factory=dict[str, str])
    twin: Mapping[str, Any] = field(default_factory=dict[str, Any])
    only: str = ""


ORACLES = {name: Exchange(**row) for name, row in load_data(__package__, "oracles.yaml").items()}
"""Oracle -> what it exchanges."""


def with_modules(stack: Stack, overrides: Mapping[str, str]) -> Stack:
    """Return `stack` with what a command replaces in it.

    Args:
        overrides: key of the stack file -> implementation; `oracle` -> names of `ORACLES`, joined by `+`, which come
            last. `localizer=truth` is one, too.

    Raises:
        ConfigError: a slot, a name or an option is wrong; `NotHere` where an oracle exchanges nothing.
    """
    others = dict(overrides)
    oracles = others.pop("oracle", "")
    if others.get("localizer") == "truth":
        del others["localizer"]
        oracles = f"{oracles}+detections".strip("+")
    stack = stack.with_choices(others)
    for name in oracles.split("+") if oracles else ():
        check_known("oracle", ORACLES, name)
        one, robot, before = ORACLES[name], stack.choice("robot"), stack
        if robot.use not in ("mujoco", ALTERED):
            raise ConfigError(f"Only robot: mujoco can be altered for --use oracle=..., not {robot.use}.")
        if one.only and one.only not in _does(stack):
            raise NotHere(f"The oracle '{name}' is for a robot that {one.only}, and this one does not.")
        for key, use in one.choices.items():
            stack = stack.with_choice(key, Choice(use))
        if one.parts:
            stack = replace(stack, profile=f"{stack.profile}:{'+'.join(one.parts)}")
        stack = stack.with_choice("robot", Choice(ALTERED, {**robot.options, **one.twin}))
        if _numbers(stack) == _numbers(before):
            raise NotHere(f"The oracle '{name}' would exchange nothing here.")
    return stack


def _does(stack: Stack) -> set[str]:
    does = {STANDS if stack.on_ground else HANGS, *([HEARS] if hears_lidar(stack) else ())}
    return does | ({PACK} if stack.choice("robot").options.get("world", "pack") in WITH_PACK else set())


def _numbers(stack: Stack) -> tuple[object, ...]:
    choices = {key: stack.choice(key) for key in KEYS}
    robot = registry.configure("robot", ALTERED, choices.pop("robot").options)
    return choices, robot, replace(load_profile(stack.profile), name="")
