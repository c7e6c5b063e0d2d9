"""Which feet carry the robot: from vertical foot forces to contact probabilities, for one robot or for many at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.types import Array


@dataclass(frozen=True, slots=True)
class ContactConfig:
    """When a foot counts as planted.

    Attributes:
        touch, leave: force above which a lifted foot has touched down, and below which it has left the ground [N].
        middle, width: force of probability one half, and of the sigmoid's scale [N].
        settle: time after touch-down for which a foot is not believed to stand still: it lands, slides and rolls [s].
        ramp: time over which it is then believed more and more [s].
    """

    touch: float = 120.0
    leave: float = 60.0
    middle: float = 150.0
    width: float = 35.0
    settle: float = 0.03
    ramp: float = 0.02


class Contact:
    """The contact state of both feet of `shape` robots.

    Attributes:
        config: thresholds and times.
        planted: (*shape, 2) whether the foot is on the ground.
        age: (*shape, 2) time since it touched down [s].
    """

    def __init__(self, config: ContactConfig, shape: tuple[int, ...] = ()) -> None:
        """Begin with feet of which nothing is known."""
        self.config = config
        self.planted: NDArray[np.bool_] = np.zeros((*shape, 2), dtype=bool)
        self.age: Array = np.zeros((*shape, 2))
        self._new: NDArray[np.bool_] = np.ones(shape, dtype=bool)

    def reset(self, where: NDArray[np.bool_] | None = None) -> None:
        """Forget the robots `where` (*shape,); None is all.

        The first force after a reset is taken as it is, and a foot that it finds loaded as planted long ago.
        """
        self._new = np.ones_like(self._new) if where is None else self._new | where

    def step(self, force: Array, dt: float) -> tuple[Array, Array]:
        """Take the next forces.

        Args:
            force: (*shape, 2) vertical force of the ground on each foot [N].
            dt: time since the previous ones [s].

        Returns:
            probability (*shape, 2) that the foot carries load, and weight (*shape, 2): how far it is to be believed
            to stand still; zero for a while after touch-down, then the probability.
        """
        c = self.config
        new = self._new[..., None]
        planted = force > np.where(self.planted & ~new, c.leave, c.touch)
        long_ago = c.settle + c.ramp
        self.age = np.where(planted, np.where(new, long_ago, np.where(self.planted, self.age + dt, 0.0)), 0.0)
        self.planted = planted
        self._new = np.zeros_like(self._new)
        probability = planted / (1.0 + np.exp((c.middle - force) / c.width))
        trust = np.minimum(np.maximum((self.age - c.settle) / c.ramp, 0.0), 1.0)
        return probability, probability * trust
