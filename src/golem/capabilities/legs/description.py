"""What a caller must know about a leg policy, read from the YAML file beside its network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.legs.base import Envelope
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.observation import HistoryOrder, ObservationLayout, Term
from golem.errors import ConfigError, unknown_name
from golem.options import check_values, fill, read_yaml, require, vector
from golem.robots.model.table import JOINT_INDEX, JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, Array

JOINTS = LEGS.stop - LEGS.start
"""Motors of the legs."""
SHIPPED = Path(__file__).parent / "policies"
"""Folder of the shipped descriptions."""


@dataclass(frozen=True, slots=True)
class ActionScaling:
    """How the network's output becomes joint targets: q0 + scale * clip(action) + swing.

    Attributes:
        scale: factor of the actions [rad]; one number, six (both legs alike) or twelve.
        clip: actions are limited to +- this before scaling.
        swing: amplitude of the stepping motion underneath (see `gait.swing_offset`) [rad]; 0 leaves it out.
        targets: lowest and highest target of each leg motor [rad]; empty limits none.
    """

    scale: float | tuple[float, ...] = 0.25
    clip: float = 100.0
    swing: float = 0.0
    targets: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Description:
    """A policy's description; the keys of its YAML file.

    Attributes:
        network: file name of the network, beside the description.
        observation: terms in the order the network wants them.
        posture: default posture q0 [rad]: six values (both legs alike), twelve, or 27 for all motors; the upper body is
            zero where it is not given.
        kp: stiffness of the leg motors [N m/rad]: one number, six or twelve.
        kd: their damping [N m s/rad].
        action: how actions become targets.
        gait: the clock behind phase_sin, phase_cos and the swing.
        envelope: the twists it can follow.
        rate: ticks per second [Hz].
        latency: time from reading the state to the targets being available [s].
        joints: what each output of the network moves, in its order; empty is the leg motors in the robot's. Outputs of
            the upper body are remembered as last_action, and move nothing.
        history: how past ticks are laid out.
        newest_first: whether the present tick comes before past ones.
    """

    network: str
    observation: tuple[Term, ...]
    posture: tuple[float, ...]
    kp: float | tuple[float, ...]
    kd: float | tuple[float, ...]
    action: ActionScaling = field(default_factory=ActionScaling)
    gait: GaitConfig = field(default_factory=GaitConfig)
    envelope: Envelope = field(default_factory=Envelope)
    rate: float = 50.0
    latency: float = 0.002
    joints: tuple[str, ...] = ()
    history: HistoryOrder = "term"
    newest_first: bool = False

    def outputs(self) -> NDArray[np.intp]:
        """Return the motor of each output, (n,). Raises ConfigError: one is unknown, named twice, or missing."""
        names = self.joints or JOINT_NAMES[LEGS]
        for name in names:
            if name not in JOINT_INDEX:
                raise unknown_name("joint", name, JOINT_NAMES)
        absent = [name for name in JOINT_NAMES[LEGS] if name not in names]
        if absent or len(set(names)) < len(names):
            raise ConfigError(
                f"The joints are every leg motor once, and others if the network moves them; "
                f"{f'{absent[0]} is missing' if absent else 'one is named twice'}."
            )
        return np.array([JOINT_INDEX[name] for name in names], dtype=np.intp)

    def q0(self) -> Array:
        """Return the default posture as (27,) [rad]. Raises ConfigError: it has another length, or is not finite."""
        if len(self.posture) == NUM_JOINTS:
            return vector("posture", self.posture, NUM_JOINTS)
        if len(self.posture) not in (JOINTS // 2, JOINTS):
            raise ConfigError(
                f"The posture is a list of {JOINTS // 2}, {JOINTS} or {NUM_JOINTS}, not of {len(self.posture)}."
            )
        q = np.zeros(NUM_JOINTS)
        q[LEGS] = vector("posture", self.posture, JOINTS, JOINTS // 2)
        return q

    def gains(self) -> tuple[Array, Array]:
        """Return kp and kd, (12,) each. Raises ConfigError: one has another length, or is negative or not finite."""
        out = vector("kp", self.kp, JOINTS, JOINTS // 2), vector("kd", self.kd, JOINTS, JOINTS // 2)
        for name, values in zip(("kp", "kd"), out, strict=True):
            if values.min() < 0.0:
                raise ConfigError(f"The {name} must not be negative, and one is {values.min():g}.")
        return out

    def action_scale(self) -> Array:
        """Return the factor of each action, (12,) [rad]. Raises ConfigError: another length, or not finite."""
        return vector("action.scale", self.action.scale, JOINTS, JOINTS // 2)

    def layout(self) -> ObservationLayout:
        """Return the observation's layout. Raises ConfigError: see `ObservationLayout`."""
        return ObservationLayout(self.observation, self.q0(), self.history, self.newest_first)


def shipped() -> tuple[str, ...]:
    """Return the names of the descriptions that come with the package."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.yaml")))


def load_description(file: str | Path, network: str | Path | None = None) -> tuple[Description, Path]:
    """Read a policy's description; return it and the path of the network, which may not exist.

    Args:
        file: path of a YAML file, or the name of a shipped description.
        network: path of the network; the file that the description names, beside it, if absent.

    Raises:
        ConfigError: no such file, not YAML, or a key or value that means nothing; names what would be valid.
    """
    path = SHIPPED / f"{file}.yaml" if str(file) in shipped() else Path(file).expanduser()
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"The policy description '{file}' cannot be read ({getattr(error, 'strerror', None) or error}); "
            f"give a path to a YAML file or one of: {', '.join(shipped())}."
        ) from error
    data = read_yaml(text, str(file))
    if not isinstance(data, Mapping):
        raise ConfigError(f"{file}: a policy description is a mapping such as 'network: policy.onnx'.")
    check_values(str(file), data)
    options = cast(Mapping[str, object], data)
    try:
        description: Description = fill(f"key of {file}", Description, options)
        check_description(description)
    except ConfigError as error:
        raise ConfigError(str(error) if str(file) in str(error) else f"{file}: {error}") from error
    return description, Path(network).expanduser() if network else path.parent / description.network


def check_description(d: Description) -> None:
    """Raise ConfigError where something in `d` cannot be meant; it names what, and what would be valid."""
    if d.envelope.height is not None:
        raise ConfigError("No policy of a description takes a height today; leave out envelope.height.")
    d.gains()
    d.action_scale()
    d.layout()
    d.outputs()
    if len(d.action.targets) not in (0, JOINTS) or any(not low < high for low, high in d.action.targets):
        raise ConfigError(f"The action.targets are {JOINTS} pairs of a lower and a higher angle, or none.")
    require(
        "",
        ("rate", d.rate, 1.0 <= d.rate < inf, "a number of ticks per second, at least 1"),
        ("latency", d.latency, 0.0 <= d.latency < inf, "a time in seconds, not negative"),
        ("action.clip", d.action.clip, d.action.clip > 0.0, "a positive number"),
        ("action.swing", d.action.swing, abs(d.action.swing) < inf, "an angle in radians"),
    )
