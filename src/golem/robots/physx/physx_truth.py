"""Where the robot in PhysX really is and what it really touches: for evaluation and viewers, never for a module."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.robots.mujoco.truth import Truth
from golem.robots.physx.bodies import PhysxBodies
from golem.types import SIDES, Array


class PhysxTruth(Truth):
    """Poses from the model that follows PhysX, contacts from PhysX itself."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, bodies: PhysxBodies) -> None:
        """Read `data` of `model`, and the contacts of `bodies`."""
        super().__init__(model, data)
        self._bodies = bodies
        feet = [model.body(f"{side}_ankle_roll_link").name for side in SIDES]
        self._part_of = {
            link.name: feet.index(link.name) if link.name in feet else len(SIDES)
            for link in bodies.links.values()
        }

    def _touching(self) -> list[tuple[str, Array]]:
        """Return the links that touch what is not the robot, and the impulse on each in the last step [N s]."""
        found: list[tuple[str, Array]] = []
        for contact in self._bodies.system.get_contacts():
            impulse = np.sum([point.impulse for point in contact.points], axis=0, initial=0.0)
            if not np.any(impulse):
                continue
            one, other = (body.entity.name for body in contact.bodies)
            if one in self._part_of and other not in self._part_of:
                found.append((one, impulse))
            elif other in self._part_of and one not in self._part_of:
                found.append((other, -impulse))
        return found

    def foot_forces(self) -> Array:
        """Return the force of the world on the left and the right foot, (2, 3) [N], in the world."""
        forces = np.zeros((2, 3))
        for name, impulse in self._touching():
            if self._part_of[name] < len(SIDES):
                forces[self._part_of[name]] += impulse / self._bodies.system.timestep
        return forces

    def touches(self) -> tuple[str, ...]:
        """Return the bodies other than the feet that touch something that is not the robot, sorted."""
        return tuple(sorted({name for name, _ in self._touching() if self._part_of[name] == len(SIDES)}))
