"""Kinematics of the upper body alone: 15 joints, two grasp frames, everything relative to base_link."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.base import ARM_COLUMNS, GRIPPER_FRAME
from golem.hardware.safety.base import SafetyLimits
from golem.robots.model import pinocchio_model
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.types import LEGS, SIDES, UPPER, Array, Side


class UpperKinematics:
    """The robot's model reduced to torso and arms; the legs do not move the hands relative to base_link.

    Attributes:
        model, data: the reduced Pinocchio model, 15 joints in motor order, and its workspace.
        lower, upper: (15,) range that the safety gate lets commands pass in [rad].
        stops: (15,) and (15,), the model's full range [rad].
        frame: index of each side's grasp frame in the model.
    """

    def __init__(self) -> None:
        """Build the model with hands and lock the legs at zero."""
        full = pinocchio_model.build(hands=True)
        legs = [full.getJointId(name) for name in JOINT_NAMES[LEGS]]
        self.model: pin.Model = pin.buildReducedModel(full, legs, pin.neutral(full))
        self.data: pin.Data = self.model.createData()
        # Every profile has the same positions; the gate may be told another one's torques.
        gate, limits = SafetyLimits.from_profile(), load_limits()
        self.lower: Array = gate.lower[UPPER].copy()
        self.upper: Array = gate.upper[UPPER].copy()
        self.stops: tuple[Array, Array] = limits.lower[UPPER].copy(), limits.upper[UPPER].copy()
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

    def exponentials(self, side: Side) -> tuple[Array, Array, Array]:
        """Return torso and arm as `ik_kernel` takes them: axes (8, 3), points (8, 3) and the hand (4, 4), at zero."""
        self.update(np.zeros(len(self.lower)))
        J = pin.getFrameJacobian(self.model, self.data, self.frame[side], pin.ReferenceFrame.WORLD)
        J = np.column_stack([J[:, 0], J[:, ARM_COLUMNS[side]]])
        return J[3:].T.copy(), np.cross(J[3:].T, J[:3].T), self.placement(side).homogeneous.copy()

    def manipulability(self, side: Side, q: Array) -> float:
        """Return the smallest singular value of the arm's own (6, 7) Jacobian at `q` (15,) [m and rad mixed]."""
        self.update(q)
        return float(np.linalg.svd(self.jacobian(side)[:, ARM_COLUMNS[side]], compute_uv=False)[-1])

    def margin(self, side: Side, q: Array) -> float:
        """Return the distance of the arm's joints from their nearest mechanical stop at `q` (15,) [rad]."""
        columns, (lower, upper) = ARM_COLUMNS[side], self.stops
        gaps = np.minimum(q[columns] - lower[columns], upper[columns] - q[columns])
        return float(gaps.min())
