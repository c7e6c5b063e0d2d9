"""What can be exchanged for truth, and which defects can be planted: see `oracles.yaml` and `defects.yaml`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from golem import registry
from golem.errors import ConfigError, unknown_name
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
    """One thing of a stack that is exchanged.

    Attributes:
        words: what takes its place.
        parts: of the realism profile that become those of `ideal`.
        choices: key of the stack file -> implementation.
        twin: options of the altered twin.
        only: what a robot does that has it, `STANDS` to `PACK`; empty is all.
        sizes: of a defect, from small to large: what `SIZE` stands for.
        option: of a defect: key of the stack file and option that is a size; the twin's where the key is `robot`.
        rung, right: of a defect: where it is tried, and the oracle that makes up for it.
    """

    words: str
    parts: Sequence[str] = ()
    choices: Mapping[str, str] = field(default_factory=dict[str, str])
    twin: Mapping[str, Any] = field(default_factory=dict[str, Any])
    only: str = ""
    sizes: Sequence[float] = ()
    option: Sequence[str] = ()
    rung: str = ""
    right: str = ""


ORACLES, DEFECTS = (
    {name: Exchange(**row) for name, row in load_data(__package__, f"{table}.yaml").items()}
    for table in ("oracles", "defects")
)
"""Oracle, or defect, -> what it exchanges."""


def with_modules(stack: Stack, overrides: Mapping[str, str]) -> Stack:
    """Return `stack` with what a command replaces in it.

    Args:
        stack: any.
        overrides: key of the stack file -> implementation; `defect` -> NAME:SIZE of `DEFECTS`, several with `+`;
            `oracle` -> names of `ORACLES`, several with `+`. Oracles come last. `localizer=truth` is one, too.

    Raises:
        ConfigError: a slot, a name or an option is wrong; `NotHere` where an oracle exchanges nothing.
    """
    others = dict(overrides)
    defects, oracles = (others.pop(key, "") for key in ("defect", "oracle"))
    if others.get("localizer") == "truth":
        del others["localizer"]
        oracles = f"{oracles}+detections".strip("+")
    for slot, use in others.items():
        stack = stack.with_choice(slot, use)
    for word in defects.split("+") if defects else ():
        name, _, size = word.partition(":")
        if name not in DEFECTS:
            raise unknown_name("defect", name, DEFECTS)
        if size not in ("1", "2", "3", "4", "5"):
            raise ConfigError(f"A defect reads NAME:SIZE with a size from 1 to 5, e.g. {name}:3, not '{word}'.")
        one = DEFECTS[name]
        stack = exchanged(stack, one)
        stack = stack.with_options(one.option[0], **{one.option[1]: one.sizes[int(size) - 1]})
    for name in oracles.split("+") if oracles else ():
        if name not in ORACLES:
            raise unknown_name("oracle", name, ORACLES)
        one, before = ORACLES[name], stack
        if one.only and one.only not in _does(stack):
            raise NotHere(f"The oracle '{name}' is for a robot that {one.only}, and this one does not.")
        stack = exchanged(stack, one)
        if _numbers(stack) == _numbers(before):
            raise NotHere(f"The oracle '{name}' would exchange nothing here.")
    return stack


def _does(stack: Stack) -> set[str]:
    does = {STANDS if stack.on_ground else HANGS, *([HEARS] if hears_lidar(stack) else ())}
    return does | ({PACK} if stack.choice("robot").options.get("world", "pack") in WITH_PACK else set())


def _numbers(stack: Stack) -> tuple[object, ...]:
    """Return what a trial of `stack` depends on."""
    choices = {key: stack.choice(key) for key in KEYS}
    robot = registry.configure("robot", ALTERED, choices.pop("robot").options)
    return choices, robot, replace(load_profile(stack.profile), name="")


def exchanged(stack: Stack, what: Exchange) -> Stack:
    """Return `stack` with one exchange.

    Raises:
        ConfigError: its robot is not the MuJoCo twin.
    """
    robot = stack.choice("robot")
    if robot.use not in ("mujoco", ALTERED):
        raise ConfigError(f"Only robot: mujoco can be altered for --use oracle=... and defect=..., not {robot.use}.")
    for key, use in what.choices.items():
        stack = stack.with_choice(key, Choice(use))
    if what.parts:
        stack = replace(stack, profile=f"{stack.profile}:{'+'.join(what.parts)}")
    return stack.with_choice("robot", Choice(ALTERED, {**robot.options, **what.twin}))
