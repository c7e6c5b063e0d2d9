"""Robots that the shipped walking network walks until a shove throws them off their twist, as `Handover` has it.

The network in training has the legs from then on. Both act for a short time, because the robot blends them, too.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from golem.capabilities.legs.almi import SHOVED
from golem.capabilities.legs.handover import CATCH_TIME
from golem.training.legs.batch_world import Rows
from golem.training.legs.ppo import Actor
from golem.types import Array

SETTLED = 1.0
"""Time for which a robot walks before it can be caught [s]: it sets off with a deviation, too."""


class Catches:
    """Who walks `n` robots.

    Attributes:
        walked: (n,) which robots the walking network has.
        last: (n, 12) its last action.
    """

    def __init__(self, n: int, walker: Actor) -> None:
        """Let `walker` walk them; nobody walks yet."""
        self._network = walker
        self.walked: NDArray[np.bool_] = np.zeros(n, dtype=bool)
        self.last: Array = np.zeros((n, 12))
        self._walks_for: Array = np.zeros(n)
        self._caught_for: Array = np.full(n, np.inf)

    def reset(self, where: Rows, walks: NDArray[np.bool_]) -> None:
        """Start the robots `where` anew; those that `walks` (m,) names are walked."""
        self.walked[where] = walks
        self.last[where] = 0.0
        self._walks_for[where] = 0.0
        self._caught_for[where] = np.inf

    def mix(self, observation: Array, action: Array) -> Array:
        """Return the (n, 12) actions that the legs get.

        Args:
            observation: (n, k) what the walking network sees.
            action: (n, 12) of the network in training.
        """
        share = np.clip(self._caught_for / CATCH_TIME, 0.0, 1.0) * ~self.walked
        rows = np.flatnonzero(share < 1.0)
        with torch.no_grad():
            seen = torch.from_numpy(observation[rows]).float()
            self.last[rows] = np.clip(self._network(seen).double().numpy(), -10.0, 10.0)
        return share[:, None] * action + (1.0 - share[:, None]) * self.last

    def step(self, off: Array, dt: float) -> NDArray[np.bool_]:
        """Advance by `dt` [s]; return (n,) who is caught now, `off` (n,) being how far each is off its twist [m/s]."""
        self._walks_for += dt
        self._caught_for += dt
        caught = self.walked & (off > SHOVED) & (self._walks_for > SETTLED)
        self.walked &= ~caught
        self._caught_for[caught] = dt
        return caught
