"""The 27 motor drives: they latch commands after a delay and run the PD loop at the physics rate."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.errors import ConfigError
from golem.kernels import njit
from golem.native import COMMAND, Record, Records, address, floats, new_record
from golem.native_messages import put_command
from golem.types import NUM_JOINTS, TICK, Array, LowCommand

SLOTS = 128
"""Commands that are on their way at most."""
_SLACK = 1e-4
"""Below the shortest physics step [s]: sums of time steps are not exact."""

MOTORS = np.dtype(
    [
        ("q", "i8", (NUM_JOINTS,)),
        ("v", "i8", (NUM_JOINTS,)),
        ("limit", "f8", (NUM_JOINTS,)),
        ("offset", "f8", (NUM_JOINTS,)),
        ("delay", "f8"),
        ("given", "i8"),
        ("taken", "i8"),
        ("latched", "i8"),
        ("constant", "f8", (NUM_JOINTS,)),
        ("kp", "f8", (NUM_JOINTS,)),
        ("kd", "f8", (NUM_JOINTS,)),
        ("tau", "f8", (NUM_JOINTS,)),
        ("times", "f8", (SLOTS,)),
        ("waiting", "f8", (SLOTS, 3, NUM_JOINTS)),
    ]
)
"""Indices, options and memory of the drives.

Waiting commands are a ring: the k-th one given is in slot k modulo `SLOTS`, rows `constant`, `kp`, `kd`. `constant` is
what the motors add to -kp q - kd dq; q is the true position, the encoders' error is in the target.
"""


@njit(cache=True, nogil=True)
def give(m: Record, command: Array, t: float) -> None:
    """Take `command` (135,) at time `t` [s]; see `Motors.give`."""
    slot = m.given % SLOTS
    m.times[slot] = t
    for i in range(NUM_JOINTS):
        kp, kd = command[3 * NUM_JOINTS + i], command[4 * NUM_JOINTS + i]
        held = kp * (command[i] - m.offset[i]) + kd * command[NUM_JOINTS + i]
        m.waiting[slot, 0, i] = held + command[2 * NUM_JOINTS + i]
        m.waiting[slot, 1, i], m.waiting[slot, 2, i] = kp, kd
    m.given += 1
    if not m.latched:
        _latch(m, slot)


@njit(cache=True, nogil=True)
def _latch(m: Record, slot: int) -> None:
    m.latched = 1
    for i in range(NUM_JOINTS):
        m.constant[i], m.kp[i], m.kd[i] = m.waiting[slot, 0, i], m.waiting[slot, 1, i], m.waiting[slot, 2, i]


@njit(cache=True, nogil=True)
def drive(m: Record, time: float, qpos: int, qvel: int, ctrl: int) -> None:
    """Set the torques for one physics step that begins at `time` [s]; arrays of the simulation by address."""
    due, newest = time - m.delay + _SLACK, -1
    while m.taken < m.given and m.times[m.taken % SLOTS] <= due:
        newest = m.taken % SLOTS
        m.taken += 1
    if newest >= 0:
        _latch(m, newest)
    if not m.latched:
        return
    q, v, out = floats(qpos), floats(qvel), floats(ctrl)
    for i in range(NUM_JOINTS):
        tau = m.constant[i] - m.kp[i] * q[m.q[i]] - m.kd[i] * v[m.v[i]]
        m.tau[i] = min(max(tau, -m.limit[i]), m.limit[i])
        out[i] = m.tau[i]


class Motors:
    """Drives of the motors; the first 27 actuators of the model.

    Attributes:
        memory: a `MOTORS`.
        tau: (27,) torque of the last physics step [N m].
    """

    def __init__(
        self, model: mujoco.MjModel, limit: Array, offset: Array, delay: float, memory: Records | None = None
    ) -> None:
        """Attach to `model`.

        Args:
            model: its first 27 actuators are the motors, named as their joints.
            limit: (27,) most torque [N m].
            offset: (27,) reported minus true joint position [rad].
            delay: time from a command being given to its torque [s].
            memory: where they remember, a `MOTORS`; None is a place of their own.

        Raises:
            ConfigError: the delay is longer than commands are kept.
        """
        if delay > (longest := (SLOTS - 2) * TICK):
            raise ConfigError(f"The motors' delay is {delay:g} s; it may be up to {longest:g} s.")
        joints = [model.joint(model.actuator(i).name) for i in range(NUM_JOINTS)]
        self._q = np.array([joint.qposadr[0] for joint in joints])
        self._v = np.array([joint.dofadr[0] for joint in joints])
        self.memory = memory = new_record(MOTORS) if memory is None else memory
        memory["q"], memory["v"] = self._q, self._v
        memory["limit"], memory["offset"], memory["delay"] = limit, offset, delay
        self._offset, self._numbers = offset, np.empty(COMMAND)
        self.tau: Array = memory["tau"][0]

    def place(self, data: mujoco.MjData, q: Array) -> None:
        """Put the joints at their true positions `q` (27,) [rad]."""
        data.qpos[self._q] = q

    def measure(self, data: mujoco.MjData) -> tuple[Array, Array, Array]:
        """Return q, dq, tau, (27,) each, as encoders and drives report them."""
        return data.qpos.take(self._q) + self._offset, data.qvel.take(self._v), self.tau.copy()

    def give(self, command: LowCommand, t: float) -> None:
        """Take `command` at time `t` [s]; it acts when its delay has passed. The very first acts at once."""
        put_command(self._numbers, command)
        give(self.memory[0], self._numbers, t)

    def drive(self, data: mujoco.MjData) -> None:
        """Set the torques for one physics step; before the first command there are none."""
        drive(self.memory[0], data.time, address(data.qpos), address(data.qvel), address(data.ctrl))
