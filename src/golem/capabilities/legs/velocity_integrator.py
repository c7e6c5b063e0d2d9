"""Makes up for what a leg controller falls short of: an integral of the velocity error, added to its twist.

Learned policies under-track by a tenth or so, each in its own way, and drift sideways a little. The base estimate knows
the velocity far better than that, so the base layer corrects it once for all of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.capabilities.legs.balance_errors import heading_frame
from golem.types import Array


@dataclass(frozen=True, slots=True)
class VelocityIntegratorConfig:
    """Options of `VelocityIntegrator`.

    Attributes:
        gain: correction per velocity error and time [1/s].
        maximum: bound of the correction of vx, vy [m/s] and wz [rad/s]; by so much the twist may leave the envelope.
            Turning falls short most, where it is asked for beside full speed ahead and to a side.
        heed: bound of each error that is integrated: a push is not the controller's doing.
        smoothing: time constant of the filter on command and measurement [s]: a period of the gait, whose sway shall
            not reach the twist.
    """

    gain: float = 0.8
    maximum: tuple[float, float, float] = (0.15, 0.15, 0.4)
    heed: tuple[float, float, float] = (0.15, 0.15, 0.15)
    smoothing: float = 0.7


class VelocityIntegrator:
    """The correction of one robot's twist."""

    def __init__(self, config: VelocityIntegratorConfig | None = None) -> None:
        """Begin without a correction."""
        self.config = config or VelocityIntegratorConfig()
        self._maximum, self._heed = np.array(self.config.maximum), np.array(self.config.heed)
        self.reset()

    def reset(self) -> None:
        """Forget what was learned: the robot stands, or another controller took over."""
        self._surplus: Array = np.zeros(3)
        self._correction: Array = np.zeros(3)

    def step(self, twist: Array, R: Array, velocity: Array, rate: Array, dt: float) -> Array:
        """Return the (3,) twist to command so that `twist` is what comes of it.

        Args:
            twist: (3,) vx, vy [m/s], wz [rad/s] that is wanted.
            R: (3, 3) rotation of base_link in a level frame.
            velocity: (3,) of base_link in that frame [m/s].
            rate: (3,) angular, in that frame [rad/s].
            dt: time since the previous step [s].
        """
        config = self.config
        measured = np.append(heading_frame(R).T @ velocity[:2], rate[2])
        # Command and measurement pass the same filter, so that its lag is no error.
        self._surplus += (twist - measured - self._surplus) * (dt / (config.smoothing + dt))
        change = config.gain * dt * np.clip(self._surplus, -self._heed, self._heed)
        self._correction = np.clip(self._correction + change, -self._maximum, self._maximum)
        return twist + self._correction
