"""The same quadratic program written with Pink, as the paper's authors do; needs the extra `pink`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.base import GRIPPER_FRAME
from golem.capabilities.arms.task_space import Reach, TaskSpaceConfig, TaskSpaceController
from golem.errors import MissingExtra
from golem.types import SIDES, Array

# Pink ignores velocity limits below 1e-10, so "does not move" is this [rad/s]; the caller clips the rest.
_STILL = 1e-9


class PinkIK(TaskSpaceController):
    """Weighted-task differential IK through Pink's tasks and limits: the paper's way, and a check on `DiffIK`.

    It has no rows for collisions: `collision_rows` counts as 0.
    """

    def __init__(self, config: TaskSpaceConfig | None = None) -> None:
        """Build the model and Pink's tasks.

        Raises:
            ConfigError: see `TaskSpaceController`.
            MissingExtra: Pink, or the solver it is used with, is not installed.
        """
        try:
            import pink
            import pink.limits
            import pink.tasks
        except ImportError as error:
            raise MissingExtra("pin-pink", "pink") from error
        super().__init__(replace(config or TaskSpaceConfig(), collision_rows=0))
        c = self.config
        self._pink = pink
        model = self.kinematics.model
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

    def solve(
        self, reaches: Sequence[Reach], lower: Array, upper: Array, damping: float, dt: float
    ) -> Array | None:
        """Set Pink's targets and let it solve; see `TaskSpaceController.solve`."""
        model, data = self.kinematics.model, self.kinematics.data
        configuration = self._pink.Configuration(
            model, data, self.q, copy_data=False, forward_kinematics=False
        )
        moving = upper - lower > 0.0
        speed = self._pink.limits.VelocityLimit(model, np.where(moving, self.speed, _STILL))
        for reach in reaches:
            here = self.kinematics.placement(reach.side)
            self._palms[reach.side].set_target(here * pin.exp6(reach.residual))
        self._posture.gain = min(1.0, self.config.posture_rate * dt)
        tasks = [*(self._palms[reach.side] for reach in reaches), self._posture]
        try:
            velocity = self._pink.solve_ik(
                configuration,
                tasks,
                dt,
                solver="daqp",
                damping=damping,
                limits=[self._range, speed],
                safety_break=False,
            )
        except self._pink.exceptions.NoSolutionFound:
            return None
        return velocity * dt
