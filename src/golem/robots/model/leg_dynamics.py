"""The legs of one robot as seen from base_link: where the soles are, how they move, what the joints weigh there.

Compiled (Pinocchio), for the 500 Hz loop of one robot; for many robots at once see `leg_kinematics`.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from golem.robots.model import pinocchio_model
from golem.robots.model.leg_kinematics import SOLE_CENTER
from golem.robots.model.table import DOF, JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, SIDES, Array

LEG = 6
"""Joints of one leg."""
_NOTHING, _AT_REST = np.zeros(3), np.zeros(LEGS.stop)


class LegDynamics:
    """Kinematics and dynamics of both legs with base_link held; axes of base_link throughout, left leg first.

    Valid after `update`, until the next:

    Attributes:
        soles: (2, 3) centres of the soles [m].
        rotations: (2, 3, 3) rotation of the ankle_roll links.
        jacobians: (2, 6, 6) of the sole centres: linear rows, then angular rows, against the leg's own six joints.
        twists: (2, 6) linear [m/s] and angular [rad/s] velocity of the soles relative to base_link.
        momentum: (2, 6) generalised momentum of each leg, M(q) dq with the motors' armature [N m s].
    """

    def __init__(self) -> None:
        """Build the model of pelvis and legs."""
        whole = pinocchio_model.build(hands=False)
        locked = [whole.getJointId(name) for name in JOINT_NAMES[LEGS.stop :]]
        self._model = pin.buildReducedModel(whole, locked, np.zeros(NUM_JOINTS))
        self._model.armature = np.full(LEGS.stop, DOF.armature)
        self._soles = []
        for side in SIDES:
            joint = self._model.getJointId(f"{side}_ankle_roll_joint")
            frame = pin.Frame(f"{side}_sole", joint, pin.SE3(np.eye(3), SOLE_CENTER), pin.FrameType.OP_FRAME)
            self._soles.append(self._model.addFrame(frame))
        self._data = self._model.createData()
        self.soles: Array = np.zeros((2, 3))
        self.rotations: Array = np.zeros((2, 3, 3))
        self.jacobians: Array = np.zeros((2, LEG, LEG))
        self.twists: Array = np.zeros((2, LEG))
        self.momentum: Array = np.zeros((2, LEG))

    def update(self, q: Array, dq: Array) -> None:
        """Set the leg joints `q`, `dq` (12,) [rad], [rad/s]."""
        model, data = self._model, self._data
        pin.computeJointJacobians(model, data, q)
        for k, frame in enumerate(self._soles):
            placement = pin.updateFramePlacement(model, data, frame)
            self.soles[k], self.rotations[k] = placement.translation, placement.rotation
            jacobian = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            self.jacobians[k] = jacobian[:, LEG * k : LEG * (k + 1)]
        self.twists = (self.jacobians @ dq.reshape(2, LEG, 1))[..., 0]
        # Inverse dynamics at rest and without weight: what dq would take as an acceleration.
        model.gravity.linear = _NOTHING
        self.momentum = pin.rnea(model, data, q, _AT_REST, dq).reshape(2, LEG)

    def gravity(self, q: Array, field: Array) -> Array:
        """Return the (2, 6) torque that carries the legs' weight in the gravitational `field` (3,) [N m], [m/s^2]."""
        self._model.gravity.linear = field
        return pin.computeGeneralizedGravity(self._model, self._data, q).reshape(2, LEG)
