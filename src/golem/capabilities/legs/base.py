"""The contract of a lower-body controller: a base twist in, 12 leg joint targets out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from golem.types import Array, BaseEstimate, LowState, Twist


@dataclass(frozen=True, slots=True)
class LegCommand:
    """What the legs are told at one tick.

    Attributes:
        q: (12,) joint targets in motor order, left leg then right leg [rad].
        kp: (12,) stiffness the controller wants at the motors [N m/rad].
        kd: (12,) damping the controller wants at the motors [N m s/rad].
    """

    q: Array
    kp: Array
    kd: Array


@runtime_checkable
class LowerBody(Protocol):
    """Turns a base twist into joint targets of the legs; standing is the zero twist.

    Attributes:
        rate: ticks per second it wants to be run at [Hz].
        latency: time from reading the state to the command being available [s].
    """

    rate: float
    latency: float

    def reset(self, state: LowState) -> None:
        """Start from the measured `state`; whatever the controller remembered is forgotten."""
        ...

    def step(self, state: LowState, base: BaseEstimate, twist: Twist, dt: float) -> LegCommand:
        """Advance by one tick.

        Args:
            state: measured joints and IMU.
            base: estimated pose of base_link in odom and its velocity.
            twist: commanded velocity in base_link; clamped to what the controller can do.
            dt: time since the previous tick [s], positive.
        """
        ...
