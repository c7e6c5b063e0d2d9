"""The gait clock and the gate that decides between standing and stepping, for one robot or for many at once.

Phases run from 0 to 1 per period, the right leg half a period behind the left. A leg is in stance while its phase is
below `stance`, so both are in double support for a moment after phase 0 and after phase 0.5.

While the robot stands the clock rests. It starts when a twist is commanded or, with `start: recovery` or `balance`,
when the standing robot cannot keep its balance with its feet where they are: the capture point (CoM position plus
velocity over the pendulum's frequency; Pratt et al., Humanoids 2006) has left the middle of the feet, or the feet are
misplaced. It stops at a double support at which the twist is zero and both errors are small again, so that nobody
stands on one leg; feet that are a little off do not keep it running for long, if the controller leaves them there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import Literal

import numpy as np
from numpy.typing import NDArray

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
        """Check the numbers.

        Raises:
            ConfigError: one of them cannot be meant.
        """
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
        if not self.follows:
            return self
        return replace(self, start="balance" if self.recovers else "never")


class Gait:
    """The gait clocks of `shape` robots.

    Attributes:
        config: the clock's parameters.
        phase: (*shape,) phase of the left leg.
        stepping: (*shape,) whether the clock runs.
    """

    def __init__(self, config: GaitConfig, shape: tuple[int, ...] = ()) -> None:
        """Begin with every robot standing."""
        self.config = config
        self.phase: Array = np.zeros(shape)
        self.stepping: Bools = np.zeros(shape, dtype=bool)
        self._idle: Array = np.zeros(shape)  # periods since there was a reason to step

    @property
    def phases(self) -> Array:
        """(*shape, 2) phase of the left and the right leg."""
        return np.stack([self.phase, (self.phase + 0.5) % 1.0], axis=-1)

    def reset(self, where: Bools | None = None) -> None:
        """Let the robots `where` stand; None is all."""
        chosen = np.ones_like(self.stepping) if where is None else where
        self.phase = np.where(chosen, 0.0, self.phase)
        self.stepping = self.stepping & ~chosen

    def step(self, commanded: Bools, capture: Array, misplaced: Array, dt: float) -> None:
        """Advance by `dt` [s].

        Args:
            commanded: (*shape,) whether a twist other than zero is asked for.
            capture: (*shape, 2) capture point relative to the middle of the feet, x ahead, y left [m].
            misplaced: (*shape,) how far the feet are from where they belong relative to each other [m].
            dt: time since the previous tick [s].
        """
        config = self.config
        error = np.hypot(capture[..., 0], capture[..., 1])
        ahead, sideways = config.capture_start
        lost = np.hypot(capture[..., 0] / ahead, capture[..., 1] / sideways) > 1.0
        lost = lost | (misplaced > config.feet_start)
        commanded = commanded & config.follows
        lost = lost & config.recovers
        wanted = np.ones_like(self.stepping) if config.start == "always" else commanded | lost
        # The unloaded foot swings first: the right one, from phase 0, while the body leans to the left. Who falls has
        # no time for the double support before it.
        begins = wanted & ~self.stepping
        skipped = np.where(lost & ~commanded, config.stance - 0.5, 0.0)
        first = np.where(capture[..., 1] >= 0.0, 0.0, 0.5) + skipped
        self.phase = np.where(begins, first, self.phase)
        self._idle = np.where(wanted, 0.0, self._idle + dt / config.period)
        content = (misplaced < config.feet_stop) | (self._idle >= config.patience)
        settled = (error < config.capture_stop) & content
        may_stop = ~wanted & (settled | (not config.recovers))
        after = self.phase + dt / config.period
        half = np.floor(2.0 * after) > np.floor(2.0 * self.phase)
        ends = self.stepping & half & may_stop
        running = (self.stepping | begins) & ~ends
        self.phase = np.where(running & ~begins, after % 1.0, self.phase)
        self.phase = np.where(ends, np.floor(2.0 * after) / 2.0 % 1.0, self.phase)
        self.stepping = running
