"""The two finger servos of one MAGPIE hand: position control with a torque ceiling, like an AX-12A."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from golem.robots.model import magpie_model
from golem.types import HandCommand, HandState, Side

SERVO_KP = 8.0
"""Stiffness of a finger servo [N m/rad]: full torque at 5 deg of lag, the order of the AX-12A's compliance slope 32."""
SERVO_KD = 0.10
"""Damping of a finger servo [N m s/rad]."""

OVERTRAVEL = 0.20
"""How far beyond closed the reference of a closing finger goes [rad]: the crank could turn to 2.05 rad, and with the
goal beyond the object both servos press with their full torque wherever between the fingers it stands."""


class HandServos:
    """Drives the cranks of one hand.

    The reference runs ahead at the servo's speed whether or not the finger follows; the torque ceiling is what
    limits the force.
    """

    def __init__(self, model: mujoco.MjModel, side: Side) -> None:
        """Find the cranks and fingers of the hand on `side`."""
        names = [magpie_model.finger_names(side, finger) for finger in magpie_model.FINGERS]
        cranks = [model.joint(crank) for crank, _, _ in names]
        self._q = [int(j.qposadr[0]) for j in cranks]
        self._v = [int(j.dofadr[0]) for j in cranks]
        self._q_finger = [int(model.joint(finger).qposadr[0]) for _, finger, _ in names]
        self._u = [int(model.actuator(crank).id) for crank, _, _ in names]
        # The hinges may be counted in opposite senses; here both cranks count positive when closing.
        self._sign = [1.0 if j.range.sum() > 0 else -1.0 for j in cranks]
        self._reference = 0.0
        self._force = magpie_model.MIN_FORCE
        self._gap = math.nan
        self._goal = 0.0

    def reset(self, data: mujoco.MjData, gap: float) -> None:
        """Place both fingers at an opening of `gap` [m]."""
        self._reference = float(magpie_model.crank_from_gap(gap))
        for q, q_finger, sign in zip(self._q, self._q_finger, self._sign, strict=True):
            data.qpos[q] = sign * self._reference
            data.qpos[q_finger] = -sign * self._reference

    def command(self, command: HandCommand, dt: float) -> None:
        """Let the reference move towards the commanded gap for `dt` [s]."""
        if command.gap != self._gap:
            self._gap = command.gap
            closes = command.gap <= 0.0
            self._goal = (
                magpie_model.CLOSED + OVERTRAVEL
                if closes
                else float(magpie_model.crank_from_gap(command.gap))
            )
        reach = magpie_model.MAX_SPEED * dt
        self._reference += min(max(self._goal - self._reference, -reach), reach)
        self._force = min(max(command.force, magpie_model.MIN_FORCE), magpie_model.MAX_FORCE)

    # Scalars below: this runs at every physics step, where arrays of two cost more than the arithmetic.

    def drive(self, data: mujoco.MjData) -> None:
        """Set the crank torques for one physics step."""
        qpos, qvel, ctrl = data.qpos, data.qvel, data.ctrl
        for q, v, u, sign in zip(self._q, self._v, self._u, self._sign, strict=True):
            theta = sign * qpos.item(q)
            ceiling = self._force * magpie_model.ARM * math.sin(magpie_model.ANGLE_OPEN + theta)
            torque = SERVO_KP * (self._reference - theta) - SERVO_KD * sign * qvel.item(v)
            ctrl[u] = sign * min(max(torque, -ceiling), ceiling)

    def read(self, data: mujoco.MjData, t: float) -> HandState:
        """Return the hand's report at time `t` [s]: the servos' present positions and loads."""
        qpos, ctrl = data.qpos, data.ctrl
        fingers: list[float] = []
        force: list[float] = []
        for q, u, sign in zip(self._q, self._u, self._sign, strict=True):
            theta = sign * qpos.item(q)
            fingers.append(float(magpie_model.pad_offset(theta)))
            force.append(
                max(sign * ctrl.item(u), 0.0) / (magpie_model.ARM * math.sin(magpie_model.ANGLE_OPEN + theta))
            )
        return HandState(t, sum(fingers), np.array(fingers), np.array(force))
