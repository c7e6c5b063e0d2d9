"""What the safety gate makes of leg commands, and when it would stop: its own rules, for many robots at once.

Left out are the rules that one sample suffices for, and that of a position outside its range: a joint on its way there
breaks the one of the braking distance first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.limiter import spared
from golem.hardware.safety.monitor import at_rest
from golem.training.legs.training_model import KD, KP, STANCE, STEP
from golem.types import LEGS, TICK, Array

REMEMBERED = 8
"""Physics steps of which the state is remembered: more than any delay."""


class LegGate:
    """The gate of `n` robots, in physics steps.

    It predicts torques from a state as old as its command is late. So a torque may exceed what it lets through, and,
    where a leg is slowed down, does for as long as that takes: legs that had never met it were stopped in 20 of 20
    shoves of 80 N s ahead, for `joint_torque` in the four that were looked at.
    """

    def __init__(self, n: int) -> None:
        limits = SafetyLimits.from_profile()
        self._velocity, self._torque = limits.velocity[LEGS], limits.torque[LEGS]
        self._lower, self._upper = limits.state_lower[LEGS], limits.state_upper[LEGS]
        self._deceleration = limits.deceleration[LEGS]
        self._bound, self._slew = limits.torque_command[LEGS], limits.slew[LEGS]
        self._range = limits.lower[LEGS], limits.upper[LEGS]
        # Speed, braking distance, torque.
        samples = limits.leg_samples, limits.leg_samples, limits.torque_samples
        self._patience = np.rint(np.array(samples) * TICK / STEP)
        self._bad: NDArray[np.int64] = np.zeros((n, 3), dtype=np.int64)
        self._rows = np.arange(n)
        self._newest = 0
        self._q: Array = np.tile(STANCE, (REMEMBERED, n, 1))
        self._dq: Array = np.zeros((REMEMBERED, n, 12))
        self._sent: Array = np.tile(STANCE, (n, 1))

    def reset(self, where: NDArray[np.intp], q: Array) -> None:
        """Start the robots `where` anew, at rest at `q` (m, 12) [rad]."""
        self._q[:, where], self._dq[:, where] = q, 0.0
        self._sent[where] = q
        self._bad[where] = 0

    def limit(self, targets: Array, delay: NDArray[np.int64]) -> Array:
        """Return the (n, 12) positions that arrive now of `targets` that were sent `delay` (n,) physics steps ago.

        As `golem.hardware.safety.limiter`: the position inside its range and within reach of the last one, then pulled
        towards the measured one until the torque kp (q_cmd - q) - kd dq that it predicts is within its bound. A joint
        that is too fast, or too close to the end of its range for its speed, is braked whatever its target: where the
        gate does that by a feed-forward torque, the position that arrives stands for it. Legs have no feed-forward of
        their own, so that the bound of its rate is not met here.
        """
        then = (self._newest - delay) % REMEMBERED
        q, dq = self._q[then, self._rows], self._dq[then, self._rows]
        damp = np.clip(-KD * dq, -self._bound, self._bound)
        up, down = spared(q, dq, self._deceleration, self._velocity, self._lower, self._upper)
        highest, lowest = up * self._bound, -down * self._bound
        rest = np.minimum(np.maximum(damp, lowest), highest)
        up = np.sqrt(2.0 * self._deceleration * np.maximum(self._range[1] - self._sent, 0.0))
        down = np.sqrt(2.0 * self._deceleration * np.maximum(self._sent - self._range[0], 0.0))
        minimum = self._sent - np.minimum(down, self._slew) * STEP
        maximum = self._sent + np.minimum(up, self._slew) * STEP
        slewed = np.clip(np.clip(targets, *self._range), minimum, maximum)
        self._sent = np.minimum(np.maximum(slewed, q + (lowest - rest) / KP), q + (highest - rest) / KP)
        return self._sent + (rest - damp) / KP

    def judge(self, q: Array, dq: Array, torque: Array) -> NDArray[np.bool_]:
        """Take in the state after a physics step, (n, 12) each; return (n,) whether it stops the robot."""
        self._newest = (self._newest + 1) % REMEMBERED
        self._q[self._newest], self._dq[self._newest] = q, dq
        rest = at_rest(q, dq, self._deceleration)
        fast = np.any(np.abs(dq) > self._velocity, axis=1)
        beyond = np.any((rest > self._upper) | (rest < self._lower), axis=1)
        strong = np.any(np.abs(torque) > self._torque, axis=1)
        now = np.stack([fast, beyond, strong], axis=1)
        self._bad = np.where(now, self._bad + 1, 0)
        return np.any(self._bad >= self._patience, axis=1)
