"""Where the frames of the nominal robot are at given joint positions."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from golem.robots.model import pinocchio_model
from golem.types import Array


class Kinematics:
    """Forward kinematics of the nominal model, computed when a frame is asked for."""

    def __init__(self) -> None:
        """Build the model with hands, fixed at base_link."""
        self._model = pinocchio_model.build(hands=True)
        self._data = self._model.createData()
        self._ids = {frame.name: i for i, frame in enumerate(self._model.frames)}
        self._q: Array | None = np.zeros(self._model.nq)

    def update(self, q: Array) -> None:
        """Set the joints `q` (27,) [rad]."""
        self._q = np.array(q, dtype=np.float64)

    def pose(self, frame: str) -> Array:
        """Return the (4, 4) pose of `frame` in base_link at the joints last set; at zero before."""
        self._compute()
        return pin.updateFramePlacement(self._model, self._data, self._ids[frame]).homogeneous

    def com(self) -> Array:
        """Return the (3,) centre of mass of the whole robot in base_link [m], hands empty; joints as for `pose`."""
        self._compute()
        return pin.centerOfMass(self._model, self._data, pin.POSITION, False).copy()

    def _compute(self) -> None:
        if self._q is not None:
            pin.forwardKinematics(self._model, self._data, self._q)
            self._q = None
