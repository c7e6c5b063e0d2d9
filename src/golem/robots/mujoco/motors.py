"""The 27 motor drives: they latch commands after a delay and run the PD loop at the physics rate."""

from __future__ import annotations

from collections import deque

import mujoco
import numpy as np

from golem.types import NUM_JOINTS, Array, LowCommand

_SLACK = 1e-4
"""Below the shortest physics step [s]: sums of time steps are not exact."""


class Motors:
    """Drives of the motors; the first 27 actuators of the model.

    Attributes:
        tau: (27,) torque of the last physics step [N m].
    """

    def __init__(self, model: mujoco.MjModel, limit: Array, offset: Array, delay: float) -> None:
        """Attach to `model`.

        Args:
            model: its first 27 actuators are the motors, named as their joints.
            limit: (27,) most torque [N m].
            offset: (27,) reported minus true joint position [rad].
            delay: time from a command being given to its torque [s].
        """
        joints = [model.joint(model.actuator(i).name) for i in range(NUM_JOINTS)]
        self._q = np.array([joint.qposadr[0] for joint in joints])
        self._v = np.array([joint.dofadr[0] for joint in joints])
        self._limit, self._offset, self._delay = limit, offset, delay
        self._given: deque[tuple[float, LowCommand]] = deque()
        self._command: LowCommand | None = None
        self._held = np.zeros(NUM_JOINTS)
        self.tau: Array = np.zeros(NUM_JOINTS)

    def place(self, data: mujoco.MjData, q: Array) -> None:
        """Put the joints at their true positions `q` (27,) [rad]."""
        data.qpos[self._q] = q

    def measure(self, data: mujoco.MjData) -> tuple[Array, Array, Array]:
        """Return q, dq, tau, (27,) each, as encoders and drives report them."""
        return data.qpos.take(self._q) + self._offset, data.qvel.take(self._v), self.tau.copy()

    def give(self, command: LowCommand, t: float) -> None:
        """Take `command` at time `t` [s]; it acts when its delay has passed. The very first acts at once."""
        self._given.append((t, command))
        if self._command is None:
            self._latch(command)

    def drive(self, data: mujoco.MjData) -> None:
        """Set the torques for one physics step; before the first command there are none."""
        due = data.time - self._delay + _SLACK
        newest = None
        while self._given and self._given[0][0] <= due:
            newest = self._given.popleft()[1]
        if newest is not None:
            self._latch(newest)
        command = self._command
        if command is None:
            return
        tau = self._held - command.kp * data.qpos.take(self._q) - command.kd * data.qvel.take(self._v)
        self.tau = np.minimum(np.maximum(tau, -self._limit), self._limit)
        data.ctrl[:NUM_JOINTS] = self.tau

    def _latch(self, command: LowCommand) -> None:
        self._command = command
        # What the motors add to -kp q - kd dq; q is the true position, the encoders' error is in the target.
        self._held = command.kp * (command.q - self._offset) + command.kd * command.dq + command.tau
