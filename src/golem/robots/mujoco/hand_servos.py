"""The two finger servos of one MAGPIE hand: position control with a torque ceiling, like an AX-12A."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from golem.kernels import njit
from golem.native import Record, Records, address, floats, new_record
from golem.robots.model import magpie_model
from golem.types import Array, HandCommand, HandState, Side

SERVO_KP = 8.0
"""Stiffness of a finger servo [N m/rad]: full torque at 5 deg of lag, the order of the AX-12A's compliance slope 32."""
SERVO_KD = 0.10
"""Damping of a finger servo [N m s/rad]."""

OVERTRAVEL = 0.20
"""How far beyond closed the reference of a closing finger goes [rad]: the crank could turn to 2.05 rad, and with the
goal beyond the object both servos press with their full torque wherever between the fingers it stands."""


_OFFSET = magpie_model.pad_offset(0.0) - magpie_model.ARM * math.cos(magpie_model.ANGLE_OPEN)
"""Distance of a pad from the hand's centre plane, less what the crank's angle adds [m]."""

HAND = np.dtype(
    [
        *((name, "i8", (2,)) for name in ("q", "v", "u")),
        ("sign", "f8", (2,)),
        ("commanded", "i8"),
        *((name, "f8") for name in ("gap", "goal", "force", "reference")),
    ]
)
"""Indices, signs and memory of the servos of one hand; angles of the cranks are positive when closing [rad]."""


@njit(cache=True, nogil=True)
def move_reference(h: Record, dt: float) -> None:
    """Let the reference move towards its goal for `dt` [s]."""
    reach = magpie_model.MAX_SPEED * dt
    h.reference += min(max(h.goal - h.reference, -reach), reach)


@njit(cache=True, nogil=True)
def drive_hand(h: Record, qpos: int, qvel: int, ctrl: int) -> None:
    """Set the crank torques for one physics step; arrays of the simulation by address."""
    q, v, out = floats(qpos), floats(qvel), floats(ctrl)
    for k in range(2):
        sign = h.sign[k]
        theta = sign * q[h.q[k]]
        ceiling = h.force * magpie_model.ARM * math.sin(magpie_model.ANGLE_OPEN + theta)
        torque = SERVO_KP * (h.reference - theta) - SERVO_KD * sign * v[h.v[k]]
        out[h.u[k]] = sign * min(max(torque, -ceiling), ceiling)


@njit(cache=True, nogil=True)
def read_hand(h: Record, qpos: int, ctrl: int, fingers: Array, force: Array) -> None:
    """Write what both fingers report, (2,) each; see `HandState`. Arrays of the simulation by address."""
    q, u = floats(qpos), floats(ctrl)
    for k in range(2):
        angle = magpie_model.ANGLE_OPEN + h.sign[k] * q[h.q[k]]
        fingers[k] = _OFFSET + magpie_model.ARM * math.cos(angle)
        force[k] = max(h.sign[k] * u[h.u[k]], 0.0) / (magpie_model.ARM * math.sin(angle))


class HandServos:
    """Drives the cranks of one hand. `memory`: a `HAND`.

    The reference runs ahead at the servo's speed whether or not the finger follows; the torque ceiling is what
    limits the force.
    """

    def __init__(self, model: mujoco.MjModel, side: Side, memory: Records | None = None) -> None:
        """Find cranks and fingers of the hand on `side`; `memory`, a `HAND`, None for one of its own."""
        names = [magpie_model.finger_names(side, finger) for finger in magpie_model.FINGERS]
        cranks = [model.joint(crank) for crank, _, _ in names]
        self._q_finger = [int(model.joint(finger).qposadr[0]) for _, finger, _ in names]
        self.memory = memory = new_record(HAND) if memory is None else memory
        memory["q"] = [int(j.qposadr[0]) for j in cranks]
        memory["v"] = [int(j.dofadr[0]) for j in cranks]
        memory["u"] = [int(model.actuator(crank).id) for crank, _, _ in names]
        # The hinges may be counted in opposite senses; here both cranks count positive when closing.
        memory["sign"] = [1.0 if j.range.sum() > 0 else -1.0 for j in cranks]
        memory["force"], memory["gap"] = magpie_model.MIN_FORCE, math.nan

    def reset(self, data: mujoco.MjData, gap: float) -> None:
        """Place both fingers at an opening of `gap` [m]."""
        row = self.memory[0]
        row["reference"] = reference = float(magpie_model.crank_from_gap(gap))
        for q, q_finger, sign in zip(row["q"], self._q_finger, row["sign"], strict=True):
            data.qpos[q] = sign * reference
            data.qpos[q_finger] = -sign * reference

    def take(self, command: HandCommand) -> None:
        """Take a command; the reference moves towards its gap while time passes."""
        row = self.memory[0]
        if command.gap != row["gap"]:
            row["gap"] = command.gap
            closes = command.gap <= 0.0
            row["goal"] = (
                magpie_model.CLOSED + OVERTRAVEL if closes else float(magpie_model.crank_from_gap(command.gap))
            )
        row["force"] = min(max(command.force, magpie_model.MIN_FORCE), magpie_model.MAX_FORCE)
        row["commanded"] = 1

    def command(self, command: HandCommand, dt: float) -> None:
        """Let the reference move towards the commanded gap for `dt` [s]."""
        self.take(command)
        move_reference(self.memory[0], dt)

    def drive(self, data: mujoco.MjData) -> None:
        """Set the crank torques for one physics step."""
        drive_hand(self.memory[0], address(data.qpos), address(data.qvel), address(data.ctrl))

    def read(self, data: mujoco.MjData, t: float) -> HandState:
        """Return the hand's report at time `t` [s]: the servos' present positions and loads."""
        fingers, force = np.empty(2), np.empty(2)
        read_hand(self.memory[0], address(data.qpos), address(data.ctrl), fingers, force)
        return HandState(t, float(fingers.sum()), fingers, force)
