"""Sampling planners over spline knots: the cross-entropy method and predictive sampling.

Both keep a plan of joint targets at evenly spaced knots, linear between them, draw variations of it, and move the plan
towards what turned out cheap: the mean of the cheapest share (CEM; de Boer et al., Annals of OR 2005) or the cheapest
alone (predictive sampling; Howell et al., arXiv 2212.00541). One iteration per plan; the next one starts from the plan
shifted by the time that has passed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from golem.errors import ConfigError
from golem.types import Array

Method = Literal["cem", "predictive_sampling"]


@dataclass(frozen=True, slots=True)
class PlannerConfig:
    """How plans are varied and chosen.

    Attributes:
        method: `cem` or `predictive_sampling`.
        samples: rollouts per plan, the present plan among them.
        knots: knots of the spline.
        elite: share of the samples that CEM averages.
        gain: share of the way to that average that CEM moves a plan which is among the elite itself, so that a robot
            that stands well is not shaken by the sampling; a plan that is not goes all the way.
        noise: standard deviation of hip yaw, pitch, roll, knee, ankle pitch, roll that sampling starts from [rad].
        narrowest: CEM fits the noise to the elite, but not below this share of `noise`.
        wide: share of the samples that keep the full `noise` nevertheless: they find the way out after a push.
        seed: of the planner's own random numbers.
    """

    method: Method = "cem"
    samples: int = 12
    knots: int = 4
    elite: float = 0.17
    gain: float = 0.3
    noise: tuple[float, ...] = (0.015, 0.09, 0.06, 0.11, 0.3, 0.11)
    narrowest: float = 0.1
    wide: float = 0.25
    seed: int = 0


class Planner:
    """The plan, its noise and the random numbers."""

    def __init__(self, config: PlannerConfig, horizon: float, lower: Array, upper: Array) -> None:
        """Begin without a plan.

        Args:
            horizon: time from the first to the last knot [s].
            lower: (12,) lowest targets [rad].
            upper: (12,) highest targets [rad].

        Raises:
            ConfigError: fewer than two samples or knots, an elite outside 0 to 1, or not six values of noise.
        """
        if config.samples < 2 or config.knots < 2:
            raise ConfigError(
                f"The planner needs at least two samples and two knots, not {config.samples} and {config.knots}."
            )
        if not 0.0 < config.elite <= 1.0:
            raise ConfigError(f"The planner's elite is a share between 0 and 1, not {config.elite}.")
        if len(config.noise) != 6 or min(config.noise) <= 0.0:
            raise ConfigError(
                "The planner needs six positive values of noise: hip yaw, pitch, roll, knee, ankle pitch, roll."
            )
        self._config = config
        self._lower, self._upper = lower, upper
        self._times: Array = np.linspace(0.0, horizon, config.knots)
        self._noise: Array = np.tile(config.noise, (config.knots, 2))
        self.reset(np.zeros_like(lower))

    def reset(self, targets: Array) -> None:
        """Plan to stay at `targets` (12,) [rad], with the noise and the random numbers of the beginning."""
        self._plan: Array = np.tile(targets, (self._config.knots, 1))
        self._deviation = self._noise.copy()
        self._random = np.random.default_rng(self._config.seed)

    def targets(self, times: Array, knots: Array | None = None) -> Array:
        """Return the targets (..., len(times), 12) at `times` [s] of `knots` (..., knots, 12) or of the plan [rad].

        Beyond the last knot the targets stay where they are.
        """
        place = np.clip(times / self._times[1], 0.0, self._config.knots - 1)
        first = np.minimum(place.astype(int), self._config.knots - 2)
        share = (place - first)[:, None]
        values = self._plan if knots is None else knots
        return (1.0 - share) * values[..., first, :] + share * values[..., first + 1, :]

    def shift(self, dt: float) -> None:
        """Let the plan begin `dt` later [s]."""
        self._plan = self.targets(self._times + dt)

    def move(self, by: Array) -> None:
        """Let the whole plan go along with a reference posture that has moved `by` (12,) [rad]."""
        self._plan = np.clip(self._plan + by, self._lower, self._upper)

    def sample(self) -> Array:
        """Return the knots (samples, knots, 12) to try; the first are those of the present plan."""
        noise = self._random.standard_normal((self._config.samples - 1, *self._plan.shape))
        wide = round(self._config.wide * len(noise))
        noise[:wide] *= self._noise
        noise[wide:] *= self._deviation
        varied = np.clip(self._plan + noise, self._lower, self._upper)
        return np.concatenate([self._plan[None], varied])

    def update(self, knots: Array, costs: Array) -> bool:
        """Move the plan towards the cheap ones of `knots` (samples, knots, 12), which cost `costs` (samples,).

        Rollouts whose cost is not finite lose against all others; where there are no others the plan stays, and False
        is returned.
        """
        config = self._config
        order = np.argsort(np.where(np.isfinite(costs), costs, np.inf), kind="stable")
        order = order[: np.count_nonzero(np.isfinite(costs))]
        if not len(order):
            return False
        if config.method == "predictive_sampling":
            self._plan = knots[order[0]]
            return True
        best = order[: max(2, round(config.elite * config.samples))]
        elite = knots[best]
        gain = config.gain if 0 in best else 1.0
        self._plan = self._plan + gain * (elite.mean(axis=0) - self._plan)
        self._deviation = np.clip(elite.std(axis=0), config.narrowest * self._noise, self._noise)
        return True
