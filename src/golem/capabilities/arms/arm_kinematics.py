"""Kinematics of the upper body alone: 15 joints, two grasp frames, everything relative to base_link."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.base import ARM_COLUMNS, GRIPPER_FRAME
from golem.robots.model import pinocchio_model
from golem.robots.model.limits import load_limits
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, SIDES, UPPER, Array, Side


class UpperKinematics:
    """The robot's model reduced to torso and arms; the legs do not move the hands relative to base_link.

    Attributes:
        model, data: the reduced Pinocchio model, 15 joints in motor order, and its workspace.
        lower, upper: (15,) position limits [rad].
        frame: index of each side's grasp frame in the model.
    """

    def __init__(self) -> None:
        """Build the model with hands and lock the legs at zero."""
        full = pinocchio_model.build(hands=True)
        legs = [full.getJointId(name) for name in JOINT_NAMES[LEGS]]
        self.model: pin.Model = pin.buildReducedModel(full, legs, pin.neutral(full))
        self.data: pin.Data = self.model.createData()
        limits = load_limits()
        self.lower: Array = limits.lower[UPPER].copy()
        self.upper: Array = limits.upper[UPPER].copy()
        self.frame: dict[Side, int] = {side: self.model.getFrameId(GRIPPER_FRAME[side]) for side in SIDES}

    def update(self, q: Array) -> None:
        """Compute placements and Jacobians at `q` (15,) [rad]."""
        pin.computeJointJacobians(self.model, self.data, q)
        for index in self.frame.values():
            pin.updateFramePlacement(self.model, self.data, index)

    def placement(self, side: Side) -> pin.SE3:
        """Return the pose of the grasp frame of `side` in base_link at the joints last updated."""
        return self.data.oMf[self.frame[side]]

    def pose(self, side: Side, q: Array) -> Array:
        """Return the (4, 4) pose of the grasp frame of `side` in base_link at `q` (15,) [rad]."""
        self.update(q)
        return self.placement(side).homogeneous

    def jacobian(self, side: Side) -> Array:
        """Return the (6, 15) Jacobian at the joints last updated.

        Its product with the joint velocities is the grasp frame's velocity in its own axes, linear [m/s] above
        angular [rad/s].
        """
        return pin.getFrameJacobian(self.model, self.data, self.frame[side], pin.ReferenceFrame.LOCAL)

    def manipulability(self, side: Side, q: Array) -> float:
        """Return the smallest singular value of the arm's own (6, 7) Jacobian at `q` (15,) [m and rad mixed]."""
        self.update(q)
        return float(np.linalg.svd(self.jacobian(side)[:, ARM_COLUMNS[side]], compute_uv=False)[-1])

    def margin(self, side: Side, q: Array) -> float:
        """Return the distance of the arm's joints from their nearest position limit at `q` (15,) [rad]."""
        columns = ARM_COLUMNS[side]
        gaps = np.minimum(q[columns] - self.lower[columns], self.upper[columns] - q[columns])
        return float(gaps.min())
