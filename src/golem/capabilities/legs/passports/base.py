"""What all formats share: words of the trainers, values in the network's order of joints, where things stand."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any, cast

import numpy as np

from golem.capabilities.legs.base import Envelope
from golem.capabilities.legs.description import Description
from golem.capabilities.legs.observation import TERMS, Term
from golem.errors import ConfigError, shorten, unknown_name
from golem.package_data import load_data
from golem.robots.model.table import JOINT_INDEX, JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS

ASSUMED_TWISTS = Envelope((-0.5, 0.8), (-0.3, 0.3), (-0.5, 0.5))
"""Twists of a policy that says nothing about them [own: what public walking policies of the H1-2 can follow]."""
FOLLOWS = f"It can follow vx {ASSUMED_TWISTS.vx}, vy {ASSUMED_TWISTS.vy} m/s, wz {ASSUMED_TWISTS.wz} rad/s."
"""The same, as what had to be assumed."""
PERIOD = 0.8
"""Period of a gait clock that a policy sees and does not describe [s]: unitree_rl_gym's."""

_DATA = load_data(__package__, "words.yaml")
WORDS: dict[str, str] = _DATA["words"]
"""Observation terms of Isaac Lab, mjlab and Unitree, and the term of ours that each is."""
KEYS_OF: dict[str, dict[str, str]] = _DATA["keys"]
"""By format: where in its file a field of the description stands; see `Passport.keys`."""
CONSTANTS: dict[str, float] = {"height_command": 0.98, "base_height_command": 0.98, "posture_command": 0.0}
"""Commands that do not exist here, and what a policy sees instead: standing height of base_link [m], no lean."""
FOLLOWERS = ("motion_anchor_pos_b", "motion_anchor_ori_b", "motion_command", "robot_body_pos_b")
"""Terms of a policy that repeats a recorded motion, as BeyondMimic's do."""


@dataclass(frozen=True, slots=True)
class Passport:
    """A policy, what its trainer's file says of it, and what had to be assumed.

    Attributes:
        format: what the file is.
        description: what it says, in our words.
        network: path of the network, which may not exist.
        assumed: what the file does not say, a sentence each.
        keys: where in the file a field of the description stands: its key there. The key of a term of the observation
            is its place, such as `0`.
    """

    format: str
    file: Path
    description: Description
    network: Path
    assumed: tuple[str, ...] = ()
    keys: Mapping[str, str] = field(default_factory=dict[str, str])

    def where(self, name: str) -> str:
        """Return file, line and key at which the field `name` of the description stands."""
        key = self.keys.get(name, name)
        if self.file.suffix in (".yaml", ".yml"):
            for number, line in enumerate(self.file.read_text(encoding="utf-8").splitlines(), 1):
                if re.match(rf"\s*(- )?(\{{)?\s*(term: |name: )?{re.escape(key)}\b", line):
                    return f"{self.file.name}, line {number} ({key})"
        return f"{self.file.name}, {key}"


def joint_names(names: Sequence[object]) -> tuple[str, ...]:
    """Return `names` as ours, without what stands before a slash. Raises ConfigError: one is no joint of the robot."""
    plain = tuple(str(name).rpartition("/")[2] for name in names)
    for name in plain:
        if name not in JOINT_INDEX:
            raise unknown_name("joint of the H1-2", name, JOINT_NAMES)
    return plain


def numbers(what: str, value: object, size: int) -> tuple[float, ...]:
    """Return `value`, a number or a list of `size`, as `size` numbers. Raises ConfigError: it is neither."""
    row = cast("Sequence[object]", value if isinstance(value, list | tuple) else [value] * size)
    if len(row) != size or not all(isinstance(x, int | float) and not isinstance(x, bool) for x in row):
        raise ConfigError(f"The {what} is a number or a list of {size}, not {shorten(repr(cast(object, value)))}.")
    return tuple(float(cast(float, x)) for x in row)


def by_motor(names: Sequence[str], values: Sequence[float]) -> tuple[float, ...]:
    """Return the values of the joints `names` by motor (27); motors that have none get 0."""
    out = np.zeros(NUM_JOINTS)
    out[[JOINT_INDEX[name] for name in names]] = values
    return tuple(out.tolist())


def of_legs(names: Sequence[str], values: Sequence[float]) -> tuple[float, ...]:
    """Return those of the leg motors (12)."""
    return by_motor(names, values)[LEGS]


def read_term(
    name: str,
    joints: Sequence[str],
    actions: Sequence[str],
    scale: object = None,
    clip: object = None,
    history: object = 1,
    relative: bool = False,
) -> Term:
    """Return the term of ours that a trainer calls `name`.

    Args:
        joints: the joints that it shows, if it shows some.
        actions: the joints that the network moves.
        scale: None, a number or a list.
        clip: None, or the lowest and the highest value.
        history: how many ticks; 0 and None are one.
        relative: whether `joint_pos` is relative to the default posture.

    Raises:
        ConfigError: it is unknown, or what is said of it cannot be meant.
    """
    if name in FOLLOWERS:
        raise ConfigError(
            f"The policy sees '{name}': it repeats a recorded motion and follows no twist, as a lower body must."
        )
    ticks = int(history) if isinstance(history, int | float) and history >= 1 else 1
    limits = None
    if clip is not None:
        low, high = numbers(f"clip of {name}", clip, 2)
        limits = None if (low, high) == (-inf, inf) else (low, high)
    if name in CONSTANTS:
        factor = 1.0 if scale is None else numbers(f"scale of {name}", scale, 1)[0]
        return Term("one", factor * CONSTANTS[name], (), limits, ticks)
    if name not in WORDS:
        raise unknown_name("observation term of a trainer", name, (*WORDS, *CONSTANTS))
    term = WORDS[name]
    if term == "joint_angle" and relative:
        term = "joint_position"
    of: tuple[str, ...] = ()
    if term == "last_action":
        of = tuple(actions)
    elif term.startswith("joint"):
        of = tuple(joints)
    elif term == "phase":
        of = ("left_sin", "left_cos")
    size = len(of or TERMS[term])
    return Term(term, 1.0 if scale is None else numbers(f"scale of {name}", scale, size), of, limits, ticks)


def target_limits(names: Sequence[str], clip: object) -> tuple[tuple[float, float], ...]:
    """Return the limits (12) of the leg targets that the `clip` of an action gives to the joints `names`; none if None.

    Raises ConfigError: it is no list of pairs.
    """
    if clip is None:
        return ()
    pairs = [numbers("clip of the action", pair, 2) for pair in cast("list[object]", clip)]
    low, high = (of_legs(names, [pair[k] for pair in pairs]) for k in range(2))
    return tuple(zip(low, high, strict=True))


def first_file(candidates: Sequence[Path]) -> Path:
    """Return the first of `candidates` that exists, else the first."""
    return next((path for path in candidates if path.is_file()), candidates[0])


def at(data: Mapping[str, Any], *keys: str) -> Any:
    """Return what stands under `keys`. Raises ConfigError: one of them is absent."""
    value: Any = data
    for i, key in enumerate(keys):
        if not isinstance(value, Mapping) or key not in value:
            raise ConfigError(f"The key '{'.'.join(keys[: i + 1])}' is missing.")
        value = cast("Mapping[str, Any]", value)[key]
    return value
