"""The contract of a lower-body controller: a base twist and a gait phase in, 12 leg joint targets out."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, inf
from typing import Protocol, runtime_checkable

import numpy as np

from golem.capabilities.legs.gait import GaitConfig
from golem.errors import ConfigError
from golem.interfaces.payloads import LegCommand
from golem.types import Array, BaseEstimate, LowState, Twist

ZERO = Twist()
"""What stands still. Who asks for it gives this object, so that a comparison need not look inside."""
HEIGHTS = (0.75, 1.03)
"""Heights of base_link above the ground that any lower body may offer [m]: the ankle's range, and straight legs."""


@dataclass(frozen=True, slots=True)
class Envelope:
    """The twists a controller can follow; zero is always inside.

    Attributes:
        vx, vy, wz: lowest and highest of this component [m/s], [rad/s].
        height: the lowest height of base_link above the ground, its own, and the highest [m]; None takes no height and
            keeps its own.
    """

    vx: tuple[float, float] = (0.0, 0.0)
    vy: tuple[float, float] = (0.0, 0.0)
    wz: tuple[float, float] = (0.0, 0.0)
    height: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        for axis in ("vx", "vy", "wz"):
            low, high = getattr(self, axis)
            if not (-inf < low <= 0.0 <= high < inf):
                raise ConfigError(f"The envelope.{axis} is a range around zero, not {low:g} to {high:g}.")
        if self.height is not None:
            low, own, high = self.height
            if not HEIGHTS[0] <= low <= own <= high <= HEIGHTS[1]:
                said = "The envelope.height is the lowest, its own and the highest height, from 0.75 to 1.03 m"
                raise ConfigError(f"{said}, not {low:g}, {own:g}, {high:g}.")

    @property
    def axes(self) -> tuple[bool, bool, bool]:
        """Which of vx, vy and wz the controller follows at all."""
        return self.vx != (0.0, 0.0), self.vy != (0.0, 0.0), self.wz != (0.0, 0.0)

    @property
    def speed(self) -> float:
        """Greatest speed over the ground [m/s]; 0 for a controller that does not walk."""
        return hypot(*(max(-low, high) for low, high in (self.vx, self.vy)))

    def clamp(self, twist: Twist) -> Twist:
        """Return the nearest twist inside, each component of the velocity by itself, at its own height."""
        bounds = ((twist.vx, self.vx), (twist.vy, self.vy), (twist.wz, self.wz))
        return Twist(*(min(max(value, low), high) for value, (low, high) in bounds))


@dataclass(frozen=True, slots=True)
class LocomotionCommand:
    """What the base layer asks of a controller at one tick.

    Attributes:
        twist: velocity to aim at: a twist inside the controller's envelope, and the base layer's small correction (see
            `VelocityIntegratorConfig.maximum`) of the components that the envelope has; exactly zero means stand.
        phase: (2,) gait phase of the left and the right leg, 0 to 1, a leg's stance first (see `gait.Gait`).
        stepping: whether the gait clock runs; while it does not, both feet belong on the ground.
        commanded: whether the robot shall move, at once or as soon as the controller follows twists; if not, `twist`
            corrects what the last steps of a stop, or those after a push, do to its place.
        height: of base_link above the ground to aim at now [m], inside the envelope, already limited in its rate; None
            is the controller's own.
    """

    twist: Twist
    phase: Array
    stepping: bool
    commanded: bool
    height: float | None = None


STANDING = LocomotionCommand(ZERO, np.array([0.0, 0.5]), False, False)
"""Stand still."""


@runtime_checkable
class LowerBody(Protocol):
    """Moves the base with the legs; standing is the zero twist.

    The base layer (`locomotion.Locomotion`) clamps twists, runs the gait clock and decides when to step: no
    controller does that itself. It also corrects the twist by the estimated velocity and keeps a swinging foot beside
    the other; a controller that does either itself switches that off with `locomotion: {trim: off}` or
    `{foot_separation: off}` in its stack file.

    What a controller may have besides, and is asked for only where it is there:
        `started` (see `Starting`): it cannot carry the robot at once.
        `follows` (see `Following`): it follows twists only at times.
        `requires`: a tuple of what its class cannot do without. `ground` or `hoist`: a robot that stands or hangs, else
            the stack is refused. `onboard`: the robot's own computer; the twin then runs leg control of its own.
        `onboard`, a parameter of its constructor: gets that computer (`vendor.Onboard`), or None beside a real robot.

    Attributes:
        rate: ticks per second it wants to be run at [Hz], from 1 to 500.
        latency: time from reading the state to the command being available [s], at most 0.1.
        envelope: the twists it can follow, empty where it only stands, and the heights it takes, if any.
        gait: the gait clock it wants; `GaitConfig(start="never")` where it steps by itself or not at all.
    """

    rate: float
    latency: float
    envelope: Envelope
    gait: GaitConfig

    def reset(self, state: LowState) -> None:
        """Start from the measured `state`; whatever the controller remembered is forgotten."""

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        """Advance by one tick.

        Args:
            state: measured joints and IMU.
            base: estimated pose, height and velocity of base_link.
            motion: twist and gait phase to follow.
            dt: time since the previous tick [s], positive.

        Returns:
            Joint targets, gains and torque, finite. On the ground `tau` is not None: the servo cannot know what the
            legs carry.
        """
        ...


@runtime_checkable
class Starting(Protocol):
    """A lower body that has to start before it can carry the robot, as the vendor's does.

    Attributes:
        started: whether it can; asked after every step.
    """

    started: bool


@runtime_checkable
class Following(Protocol):
    """A lower body that follows twists only at times, because another controller may have the legs.

    Until then the base layer keeps the twist of a standing robot at zero, and `LocomotionCommand.commanded` says that
    it waits: the acceleration of a twist is bounded for the controller that follows it.

    Attributes:
        follows: whether it would follow a twist now.
    """

    follows: bool


def follows(controller: LowerBody) -> bool:
    """Return whether `controller` would follow a twist now."""
    # As `isinstance(controller, Following)` asks, which costs 30 calls.
    return bool(getattr(controller, "follows", True))
