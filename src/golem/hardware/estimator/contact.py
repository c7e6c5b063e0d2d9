"""Which feet carry the robot: from vertical foot forces to contact probabilities, for one robot or for many at once."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from golem.hardware.estimator import feet_kernel
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
        self._numbers: Array = np.array(astuple(config))

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
        rows = force.reshape(-1, 2)
        probability, weight = feet_kernel.contacts(
            rows, self.planted.reshape(-1, 2), self.age.reshape(-1, 2), self._new.reshape(-1), self._numbers, dt
        )
        return probability.reshape(force.shape), weight.reshape(force.shape)
