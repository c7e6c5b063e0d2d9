"""The whole robot on a floor, as leg controllers are tried on it."""

from __future__ import annotations

from golem.capabilities.legs.base import STANDING, LowerBody
from golem.evaluation.passport.trial import STEP, Floor
from golem.interfaces.payloads import LegCommand
from golem.types import Array

__all__ = ["STEP", "FloorPlant"]


class FloorPlant(Floor):
    """A floor on which controllers run in lock-step with their latency."""

    @property
    def com(self) -> Array:
        """(3,) centre of mass [m]."""
        return self.data.subtree_com[self._pelvis].copy()

    def run(self, legs: LowerBody, duration: float, push: tuple[float, float, Array] | None = None) -> bool:
        """Run `legs` in lock-step with their latency; return whether the robot is still up after `duration` [s].

        `push` is when it begins [s], how long it lasts [s] and the force (3,) [N].
        """
        every, late = round(1.0 / legs.rate / STEP), round(legs.latency / STEP)
        state, base = self.sense()
        legs.reset(state)
        latest = legs.step(state, base, STANDING, 1.0 / legs.rate)
        due: list[tuple[int, LegCommand]] = []
        for k in range(round(duration / STEP)):
            if k % every == 0:
                due.append((k + late, legs.step(*self.sense(), STANDING, 1.0 / legs.rate)))
            while due and due[0][0] <= k:
                latest = due.pop(0)[1]
            pushed = push is not None and push[0] <= k * STEP < push[0] + push[1]
            self.advance(latest, push[2] if push is not None and pushed else None)
            if self.fallen:
                return False
        return True
