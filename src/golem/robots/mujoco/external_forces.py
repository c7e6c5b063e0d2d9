"""Forces from outside on the robot's bodies: what a judge's rod or a viewer's button does to it."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from golem.errors import ConfigError, unknown_name
from golem.kernels import njit
from golem.native import Record, Records, address, floats, new_record
from golem.robots.model.table import LINKS
from golem.types import Array

_MOST = len(LINKS)

PUSHES = np.dtype(
    [
        ("count", "i8"),
        ("body", "i8", (_MOST,)),
        ("force", "f8", (_MOST, 3)),
        ("off_centre", "i8", (_MOST,)),
        ("point", "f8", (_MOST, 3)),
    ]
)
"""The forces that act: (3,) in the world [N]; where one is `off_centre`, at a point in the frame of its link [m]."""


@njit(cache=True, nogil=True)
def clear_pushes(m: Record, xfrc: int) -> None:
    """Take the forces of the previous physics step off; arrays of the simulation by address."""
    out = floats(xfrc)
    for k in range(m.count):
        for i in range(6):
            out[6 * m.body[k] + i] = 0.0


@njit(cache=True, nogil=True)
def apply_pushes(m: Record, xfrc: int, xpos: int, xmat: int, xipos: int) -> None:
    """Add the forces for the present state to whatever else acts on the bodies; arrays by address."""
    out, p, R, com, lever = floats(xfrc), floats(xpos), floats(xmat), floats(xipos), np.empty(3)
    for k in range(m.count):
        at, body, force = 6 * m.body[k], m.body[k], m.force[k]
        for i in range(3):
            out[at + i] += force[i]
        if m.off_centre[k]:
            # MuJoCo applies it at the centre of mass.
            for i in range(3):
                lever[i] = p[3 * body + i] - com[3 * body + i]
                for j in range(3):
                    lever[i] += R[9 * body + 3 * i + j] * m.point[k, j]
            out[at + 3] += lever[1] * force[2] - lever[2] * force[1]
            out[at + 4] += lever[2] * force[0] - lever[0] * force[2]
            out[at + 5] += lever[0] * force[1] - lever[1] * force[0]


class Pushes:
    """External forces, each constant in the world until it is changed.

    Attributes:
        memory: a `PUSHES`.
    """

    def __init__(self, model: mujoco.MjModel, memory: Records | None = None) -> None:
        """Push bodies of `model`; there is no force yet. `memory`, a `PUSHES`, None for one of its own."""
        self._model = model
        self.memory = new_record(PUSHES) if memory is None else memory
        self._rows: dict[str, int] = {}

    def set(self, force: Array, body: str, point: Array | None) -> None:
        """Replace the force on `body`; arguments as in `MujocoRobot.push`.

        Raises:
            ConfigError: the robot has no such link, or an array has another shape or is not finite.
        """
        if body not in LINKS:
            raise unknown_name("link to push", body, LINKS)
        force, point = np.array(force, float), None if point is None else np.array(point, float)
        for array in (force, point):
            if array is not None and (array.shape != (3,) or not all(map(math.isfinite, array.tolist()))):
                raise ConfigError("A push is a force of three finite numbers [N] at a point of three [m].")
        row, k = self.memory[0], self._rows.get(body)
        if k is None:
            k = self._rows[body] = len(self._rows)
            row["count"], row["body"][k] = k + 1, self._model.body(body).id
        row["force"][k], row["off_centre"][k] = force, point is not None
        if point is not None:
            row["point"][k] = point

    @property
    def acting(self) -> tuple[str, Array] | None:
        """The link with the largest force on it, and that force (3,) in the world [N]; None where there is none."""
        row = self.memory[0]
        forces = row["force"][: row["count"]]
        if not forces.any():
            return None
        k = int((forces * forces).sum(axis=1).argmax())
        return self._model.body(int(row["body"][k])).name, forces[k].copy()

    def clear(self, data: mujoco.MjData) -> None:
        """Take the forces of the previous physics step off."""
        clear_pushes(self.memory[0], address(data.xfrc_applied))

    def apply(self, data: mujoco.MjData) -> None:
        """Add the forces for the present state to whatever else acts on the bodies."""
        places = address(data.xpos), address(data.xmat), address(data.xipos)
        apply_pushes(self.memory[0], address(data.xfrc_applied), *places)
