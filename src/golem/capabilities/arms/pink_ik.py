"""The same quadratic program written with Pink, as the paper's authors do; needs the extra `pink`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.base import GRIPPER_FRAME
from golem.capabilities.arms.task_kernel import LAMBDA
from golem.capabilities.arms.task_space import TaskSpaceConfig, TaskSpaceController
from golem.errors import needs
from golem.types import SIDES, Array

# Pink ignores velocity limits below 1e-10, so "does not move" is this [rad/s]; the caller clips the rest.
_STILL = 1e-9


class PinkIK(TaskSpaceController):
    """Weighted-task differential IK through Pink's tasks and limits: the paper's way, and a check on `DiffIK`.

    It has no rows for collisions: `collision_rows` counts as 0.
    """

    def __init__(self, config: TaskSpaceConfig | None = None) -> None:
        """Build the model. Raises ConfigError: see `TaskSpaceController`; MissingExtra: no Pink, or no solver."""
        with needs("pin-pink", "pink"):
            import pink
            import pink.limits
            import pink.tasks
        super().__init__(replace(config or TaskSpaceConfig(), collision_rows=0))
        c = self.config
        self._pink = pink
        model = self._kinematics.model
        model.lowerPositionLimit, model.upperPositionLimit = self.lower, self.upper
        self._palms = {
            side: pink.tasks.FrameTask(
                GRIPPER_FRAME[side],
                position_cost=float(np.sqrt(c.position_weight)),
                orientation_cost=float(np.sqrt(c.rotation_weight)),
                gain=c.palm_gain,
            )
            for side in SIDES
        }
        # Pink takes one cost per joint too, though its signature says one for all.
        self._posture = pink.tasks.PostureTask(cost=list(np.sqrt(self.soft)))  # pyright: ignore[reportArgumentType]
        self._posture.set_target(self.rest)
        self._range = pink.limits.ConfigurationLimit(model, config_limit_gain=1.0)

    def solve(self, dt: float) -> Array | None:
        k, task = self.kinematics, self.task
        configuration = self._pink.Configuration(k.model, k.data, self.q, copy_data=False, forward_kinematics=False)
        moving = (task.above > task.below)[: len(self.q)]
        speed = self._pink.limits.VelocityLimit(k.model, np.where(moving, self.speed, _STILL))
        wanted = [i for i in range(2) if task.wanted[i]]
        for i in wanted:
            self._palms[SIDES[i]].set_target(k.placement(SIDES[i]) * pin.exp6(task.residual[i]))
        self._posture.gain = min(1.0, self.config.posture_rate * dt)
        tasks = [*(self._palms[SIDES[i]] for i in wanted), self._posture]
        try:
            damping, limits = float(task.state[LAMBDA]), [self._range, speed]
            velocity = self._pink.solve_ik(
                configuration, tasks, dt, solver="daqp", damping=damping, limits=limits, safety_break=False
            )
        except self._pink.exceptions.NoSolutionFound:
            return None
        return velocity * dt
