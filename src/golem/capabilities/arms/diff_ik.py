"""Differential inverse kinematics as one small quadratic program per tick (Pinocchio for J, DAQP for the program).

The paper's Eq. (qp), written for the step dq = q_dot dt:

    min_dq  sum_i w_i | J_i(q) dq - alpha_i r_i(q) |^2 + lambda |dq|^2   s.t.   dq_min <= dq <= dq_max

with four tasks: the 6-D poses of the two grasp frames, the posture of the arms, the torso. The box is the
intersection of the velocity limits with what is left to the position limits, so neither can be violated. Rows for the
nearest pairs of links, if wanted, bound how fast their distance d may shrink: grad d dq >= -gain max(d - d_min, 0).
"""

from __future__ import annotations

import daqp
import numpy as np

from golem.capabilities.arms.base import NUM_UPPER
from golem.capabilities.arms.task_kernel import COUNT
from golem.capabilities.arms.task_space import TaskSpaceConfig, TaskSpaceController
from golem.types import Array


class DiffIK(TaskSpaceController):
    """Weighted-task differential IK for torso and both arms, assembled by hand: the default."""

    def __init__(self, config: TaskSpaceConfig | None = None) -> None:
        super().__init__(config)
        self._kinds = np.zeros(len(self.task.below), np.int32)

    def solve(self, dt: float) -> Array | None:
        task, rows = self.task, int(self.task.state[COUNT])
        n = NUM_UPPER + rows
        step, _, flag, _ = daqp.solve(
            task.H, task.f, task.gradient[:rows], task.above[:n], task.below[:n], self._kinds[:n]
        )
        return step if flag > 0 else None
