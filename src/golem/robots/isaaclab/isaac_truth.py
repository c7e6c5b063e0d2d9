"""Where the robot in Isaac Lab really is and what it really touches: for evaluation and viewers, never for a module."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.robots.mujoco.truth import Truth
from golem.types import SIDES, Array


class IsaacTruth(Truth):
    """Poses from the model that follows Isaac Lab, contact forces from Isaac Lab itself."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, links: list[str]) -> None:
        """Read `data` of `model`, whose robot has the bodies `links`."""
        super().__init__(model, data)
        self._links = links
        self._soles = [links.index(f"{side}_ankle_roll_link") for side in SIDES]
        self._forces = np.zeros((len(links), 3))

    def see(self, forces: Array) -> None:
        """Take the force of the world on each link in the last step, (n, 3) [N], in the world."""
        self._forces = forces

    def foot_forces(self) -> Array:
        """Return the force of the world on the left and the right foot, (2, 3) [N], in the world."""
        return self._forces[self._soles].astype(np.float64)

    def touches(self) -> tuple[str, ...]:
        """Return the bodies other than the feet that touch something that is not the robot, sorted."""
        loaded = set(np.flatnonzero(self._forces.any(axis=1))) - set(self._soles)
        return tuple(sorted(self._links[link] for link in loaded))
