"""Forces from outside on the robot's bodies: what a judge's rod or a viewer's button does to it."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.errors import ConfigError, unknown_name
from golem.robots.model.table import LINKS
from golem.types import Array


class Pushes:
    """External forces, each constant in the world until it is changed."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Push bodies of `model`; there is no force yet."""
        self._model = model
        self._forces: dict[int, tuple[Array, Array | None]] = {}

    def set(self, force: Array, body: str, point: Array | None) -> None:
        """Replace the force on `body`; arguments as in `MujocoRobot.push`.

        Raises:
            ConfigError: the robot has no such link, or an array has another shape or is not finite.
        """
        if body not in LINKS:
            raise unknown_name("link to push", body, LINKS)
        force, point = np.array(force, float), None if point is None else np.array(point, float)
        for array in (force, point):
            if array is not None and (array.shape != (3,) or not np.isfinite(array).all()):
                raise ConfigError("A push is a force of three finite numbers [N] at a point of three [m].")
        self._forces[self._model.body(body).id] = force, point

    @property
    def acting(self) -> tuple[str, Array] | None:
        """The link with the largest force on it, and that force (3,) in the world [N]; None where there is none."""
        body, (force, _) = max(
            self._forces.items(),
            key=lambda item: float(item[1][0] @ item[1][0]),
            default=(0, (np.zeros(3), None)),
        )
        return (self._model.body(body).name, force) if force.any() else None

    def clear(self, data: mujoco.MjData) -> None:
        """Take the forces of the previous physics step off."""
        for body in self._forces:
            data.xfrc_applied[body] = 0.0

    def apply(self, data: mujoco.MjData) -> None:
        """Add the forces for the present state to whatever else acts on the bodies."""
        for body, (force, point) in self._forces.items():
            wrench = data.xfrc_applied[body]
            wrench[:3] += force
            if point is not None:
                # MuJoCo applies it at the centre of mass.
                lever = data.xpos[body] + data.xmat[body].reshape(3, 3) @ point - data.xipos[body]
                wrench[3:] += np.cross(lever, force)
