"""The contract of a source of properties: a name in, mass, friction and stiffness out, and the force that follows.

After DeliGrasp (Xie et al., 2024), which asks a language model for the three numbers, and closes with a force that
holds the weight by friction and no more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from golem.types import GRAVITY

BOUNDS = {"mass": (1e-3, 10.0), "friction": (0.05, 2.0), "stiffness": (10.0, 1e7)}
"""What a hand of this robot may be told of a thing: [kg], -, [N/m]."""


@dataclass(frozen=True, slots=True)
class Properties:
    """What a thing is like.

    Attributes:
        mass: its mass [kg].
        friction: coefficient of friction between it and the pads.
        stiffness: force that presses it together, per way that it gives [N/m].

    Raises:
        ValueError: a number is none that a thing for a hand can have.
    """

    mass: float
    friction: float
    stiffness: float

    def __post_init__(self) -> None:
        for name, (low, high) in BOUNDS.items():
            value = getattr(self, name)
            if not math.isfinite(value) or not low <= value <= high:
                raise ValueError(f"{name} is {value:g}, not from {low:g} to {high:g}")


class PropertySource(Protocol):
    """Tells what things are like by their names.

    It is passive; the same name gives the same answer for as long as it lives.

    Attributes:
        latency: time that an answer takes [s]: the skill waits for so long in lock-step.
    """

    latency: float

    def properties(self, label: str) -> Properties:
        """Return what a thing of class `label` is like.

        Raises:
            ConfigError: it knows nothing of that name; the message says of which it does.
        """
        ...


def holding_force(thing: Properties, safety: float, squeeze: float) -> float:
    """Return the force of each finger [N] that holds a thing between two pads, and does not crush it.

    Two pads with friction mu carry the weight m g where 2 mu F >= m g (Coulomb). It is multiplied by `safety`, for
    motion and for what the numbers are off by, and never more than what presses the thing together by `squeeze` [m].
    """
    return min(safety * thing.mass * GRAVITY / (2.0 * thing.friction), thing.stiffness * squeeze)
