"""Differential inverse kinematics as one small quadratic program per tick (Pinocchio for J, DAQP for the program).

The paper's Eq. (qp), written for the step dq = q_dot dt:

    min_dq  sum_i w_i | J_i(q) dq - alpha_i r_i(q) |^2 + lambda |dq|^2   s.t.   dq_min <= dq <= dq_max

with four tasks: the 6-D poses of the two grasp frames, the posture of the arms, the torso. The box is the
intersection of the velocity limits with what is left to the position limits, so neither can be violated. Rows for the
nearest pairs of links, if wanted, bound how fast their distance d may shrink: grad d dq >= -gain max(d - d_min, 0).
"""

from __future__ import annotations

from collections.abc import Sequence

import daqp
import numpy as np
import pinocchio as pin

from golem.capabilities.arms.base import NUM_UPPER
from golem.capabilities.arms.task_space import Reach, TaskSpaceConfig, TaskSpaceController
from golem.types import Array

_DIAGONAL = np.diag_indices(NUM_UPPER)
_FREE = 1e30


class DiffIK(TaskSpaceController):
    """Weighted-task differential IK for torso and both arms, assembled by hand: the default."""

    def __init__(self, config: TaskSpaceConfig | None = None) -> None:
        """Build the model; see `TaskSpaceController`."""
        super().__init__(config)
        c = self.config
        self._root = np.repeat(np.sqrt([c.position_weight, c.rotation_weight]), 3)

    def solve(
        self, reaches: Sequence[Reach], lower: Array, upper: Array, damping: float, dt: float
    ) -> Array | None:
        """Assemble H and f of the program over the (15,) step and solve it; see `TaskSpaceController.solve`."""
        c = self.config
        rows: list[Array] = []
        wanted: list[Array] = []
        for reach in reaches:
            # d log(T_goal^-1 T_frame) = Jlog6 J dq, the exact derivative of the residual.
            jacobian = pin.Jlog6(reach.to_frame) @ self.kinematics.jacobian(reach.side)
            rows.append(self._root[:, None] * jacobian)
            wanted.append(c.palm_gain * (self._root * reach.residual))
        A = np.concatenate(rows)
        H = A.T @ A
        H[_DIAGONAL] += self.soft + damping
        pull = self.soft * min(1.0, c.posture_rate * dt) * (self.rest - self.q)
        f = -(np.concatenate(wanted) @ A + pull)
        rows_near, bounds = self.collision_bounds()
        above = np.concatenate([upper, np.full(len(bounds), _FREE)])
        below = np.concatenate([lower, bounds])
        step, _, flag, _ = daqp.solve(H, f, rows_near, above, below, np.zeros(len(below), dtype=np.int32))
        return step if flag > 0 else None
