"""The gait clock and the rule that decides between standing and stepping, for one robot or for many at once.

Phases run from 0 to 1 per period, the right leg half a period behind the left. A leg is in stance while its phase is
below `stance`, so both are in double support for a moment after phase 0 and after phase 0.5.

While the robot stands the clock rests. It starts when a twist is commanded. With `start: recovery` or `balance` it
also starts when the robot cannot keep its balance where its feet are: the capture point has left their middle, or they
are misplaced. That point is CoM position plus velocity over the pendulum's frequency (Pratt et al., Humanoids 2006).
The clock stops at a double support, so that nobody stands on one leg, once the twist is zero and both errors are small.
Feet that are a little off do not keep it running for long, if the controller leaves them there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from math import inf
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from golem.kernels import njit
from golem.native import Record, Records, new_record
from golem.options import require
from golem.types import Array

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class GaitConfig:
    """What a controller wants of its gait clock.

    Attributes:
        period: time of one step of each foot [s].
        stance: share of the period for which a foot stays on the ground, more than a half.
        start: when the clock runs: `never`, at a `command` other than zero, where `balance` asks for it, both
            (`recovery`), or `always`.
        capture_start: half axes, ahead and sideways, of the ellipse about the middle of the feet out of which the
            capture point of a robot that stands must come for it to step [m]: well inside the soles, because a push
            grows by a fifth until the foot is off the ground.
        capture_stop: distance of the capture point from the middle of the feet below which it may stop [m].
        feet_start, feet_stop: how far the feet are from where they belong relative to each other, likewise [m].
        patience: periods after the last reason for a step from which feet that are misplaced by more than `feet_stop`
            do not keep it stepping: a controller that has not put them right by then is content with them.
    """

    period: float = 0.7
    stance: float = 0.55
    start: Literal["never", "command", "balance", "recovery", "always"] = "recovery"
    capture_start: tuple[float, float] = (0.10, 0.15)
    capture_stop: float = 0.07
    feet_start: float = 0.12
    feet_stop: float = 0.05
    patience: float = 1.0

    def __post_init__(self) -> None:
        lengths = (*self.capture_start, self.capture_stop, self.feet_start, self.feet_stop)
        require(
            "gait.",
            ("period", self.period, 0.0 < self.period < inf, "a time in seconds, positive"),
            ("stance", self.stance, 0.5 < self.stance < 1.0, "a share of the period, between 0.5 and 1"),
            ("capture and gait.feet", min(lengths), min(lengths) > 0.0, "a length in metres, positive"),
            ("patience", self.patience, self.patience >= 0.0, "a number of periods"),
        )

    @property
    def follows(self) -> bool:
        """Whether the clock starts at a commanded twist."""
        return self.start in ("command", "recovery")

    @property
    def recovers(self) -> bool:
        """Whether the clock starts where balance asks for a step."""
        return self.start in ("balance", "recovery")

    def without_commands(self) -> GaitConfig:
        """Return the same clock for a controller that is to follow no twist."""
        return replace(self, start="balance" if self.recovers else "never") if self.follows else self


GAIT = np.dtype([("phase", "f8"), ("idle", "f8"), ("stepping", "?")], align=True)
"""One clock: phase of the left leg, periods since there was a reason to step, whether it runs."""
GAIT_OPTIONS = np.dtype(
    [
        *((name, "f8") for name in ("period", "stance", "ahead", "sideways", "capture_stop")),
        *((name, "f8") for name in ("feet_start", "feet_stop", "patience")),
        *((name, "?") for name in ("follows", "recovers", "always")),
    ]
)
"""A `GaitConfig`; `ahead` and `sideways` are its `capture_start`."""


@njit(cache=True, nogil=True)
def step_gait(g: Record, o: Record, commanded: bool, x: float, y: float, misplaced: float, dt: float) -> None:
    """Do what `Gait.step` does for the clock `g`, a `GAIT`, under the options `o`; the capture point is at `x`, `y`."""
    commanded = commanded and o.follows
    lost = o.recovers and (math.hypot(x / o.ahead, y / o.sideways) > 1.0 or misplaced > o.feet_start)
    wanted = o.always or commanded or lost
    g.idle = 0.0 if wanted else g.idle + dt / o.period
    if not g.stepping:
        if wanted:
            # The unloaded foot swings first: the right one, from phase 0, while the body leans to the left. Who falls
            # has no time for the double support before it.
            g.phase = (0.0 if y >= 0.0 else 0.5) + (o.stance - 0.5 if lost and not commanded else 0.0)
            g.stepping = True
        return
    content = misplaced < o.feet_stop or g.idle >= o.patience
    settled = not o.recovers or (content and math.hypot(x, y) < o.capture_stop)
    after = g.phase + dt / o.period
    halves = math.floor(2.0 * after)
    if halves > math.floor(2.0 * g.phase) and not wanted and settled:
        g.phase, g.stepping = halves / 2.0 % 1.0, False
    else:
        g.phase = after % 1.0


@njit(cache=True, nogil=True)
def _step_gaits(
    gaits: Records, options: Records, commanded: Bools, capture: Array, misplaced: Array, dt: float
) -> None:
    for i in range(len(gaits)):
        step_gait(gaits[i], options[0], commanded[i], capture[i, 0], capture[i, 1], misplaced[i], dt)


class Gait:
    """The gait clocks of `shape` robots.

    Attributes:
        config: the clock's parameters; see `use`.
        memory, options: (*shape,) of `GAIT`, (1,) of `GAIT_OPTIONS`.
        phase: (*shape,) phase of the left leg.
        stepping: (*shape,) whether the clock runs.
    """

    def __init__(self, config: GaitConfig, shape: tuple[int, ...] = ()) -> None:
        self.memory: Records = np.zeros(shape, GAIT)
        self.options = new_record(GAIT_OPTIONS)
        self.phase: Array = self.memory["phase"]
        self.stepping: Bools = self.memory["stepping"]
        self.use(config)

    def use(self, config: GaitConfig) -> None:
        """Run by `config` from now on."""
        self.config = c = config
        lengths = (*c.capture_start, c.capture_stop, c.feet_start, c.feet_stop)
        flags = (c.follows, c.recovers, c.start == "always")
        self.options[0] = (c.period, c.stance, *lengths, c.patience, *flags)

    @property
    def phases(self) -> Array:
        """(*shape, 2) phase of the left and the right leg."""
        out = np.empty((*self.phase.shape, 2))
        out[..., 0], out[..., 1] = self.phase, (self.phase + 0.5) % 1.0
        return out

    def reset(self, where: Bools | None = None) -> None:
        """Let the robots `where` stand; None is all."""
        chosen = ... if where is None else where
        self.phase[chosen], self.stepping[chosen] = 0.0, False

    def step(self, commanded: Bools, capture: Array, misplaced: Array, dt: float) -> None:
        """Advance by `dt` [s].

        Args:
            commanded: (*shape,) whether a twist other than zero is asked for.
            capture: (*shape, 2) capture point relative to the middle of the feet, x ahead, y left [m].
            misplaced: (*shape,) how far the feet are from where they belong relative to each other [m].
        """
        points = np.ascontiguousarray(capture).reshape(-1, 2)
        _step_gaits(self.memory.reshape(-1), self.options, np.ravel(commanded), points, np.ravel(misplaced), dt)


LIFT = np.array([0.0, -1.0, 0.0, 2.0, -1.0, 0.0])
"""Shares of hip yaw, hip pitch, hip roll, knee, ankle pitch, ankle roll: they lift the foot and leave it level."""


def swing_share(phase: Array, stance: float) -> Array:
    """Return how much of its swing a leg at `phase` (0 to 1) has done; 0 in stance, which comes first."""
    return np.maximum(phase - stance, 0.0) / (1.0 - stance)


def rise(swing: Array) -> Array:
    """Return sin^2 of a swing that runs from 0 to 1: 1 in its middle, at rest at both ends."""
    return np.square(np.sin(np.pi * swing))


@njit(cache=True, nogil=True)
def swing_legs(phase: Array, period: float, stance: float, amplitude: float, lag: Array, out: Array) -> None:
    """Write what `swing_offset` returns of one robot into `out` (12,)."""
    for k in range(2):
        swing = max(phase[k] - stance, 0.0) / (1.0 - stance)
        lift = math.sin(math.pi * swing)
        speed = math.pi / ((1.0 - stance) * period) * math.sin(2.0 * math.pi * swing)
        for i in range(6):
            out[6 * k + i] = amplitude * (lift * lift + speed * lag[6 * k + i]) * LIFT[i]


@njit(cache=True, nogil=True)
def _swing_all(phase: Array, period: float, stance: float, amplitude: float, lag: Array, out: Array) -> None:
    for i in range(len(phase)):
        swing_legs(phase[i], period, stance, amplitude, lag, out[i])


def swing_offset(phase: Array, period: float, stance: float, amplitude: float, lag: Array) -> Array:
    """Return what swinging legs add to their joint targets [rad], (..., 12) in motor order.

    The foot rises and sinks over the leg's swing, the part of the period after `stance`, and is at rest at both ends:
    with a half sine it came down at 0.8 m/s, heel first. Targets lead by what damping holds the joints back, so that
    soft ankles keep up with hips and knees and the foot stays level.

    Args:
        phase: (..., 2) gait phase of the left and the right leg, 0 to 1, stance first.
        period: of the gait [s].
        stance: share of the period for which a foot stays on the ground, below 1.
        amplitude: peak of the hip's and the ankle's share; the knee bends by twice as much [rad].
        lag: (12,) how far each joint follows behind its target, kd / kp [s].
    """
    out = np.empty((*phase.shape[:-1], 12))
    rows = np.ascontiguousarray(phase).reshape(-1, 2)
    _swing_all(rows, period, stance, amplitude, np.ascontiguousarray(lag), out.reshape(-1, 12))
    return out
