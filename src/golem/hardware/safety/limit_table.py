"""The limits by motor as one array, which compiled code takes as a single argument."""

from __future__ import annotations

import numpy as np

from golem.types import NUM_JOINTS, Array

ROWS = (
    "lower",
    "upper",
    "slew",
    "deceleration",
    "velocity",
    "torque_command",
    "torque_rate",
    "state_lower",
    "state_upper",
    "kp_max",
    "kd_max",
    "kp_rate",
    "kd_rate",
    "middle",
    "jolt",
    "torque",
    "least_kp",
    "least_kd",
)
"""Limits with a row each; where one number holds for all motors, the row repeats it."""
LOWER, UPPER, SLEW, DECELERATION, VELOCITY, TORQUE, TORQUE_RATE, STATE_LOWER, STATE_UPPER = range(9)
KP_MAX, KD_MAX, KP_RATE, KD_RATE, MIDDLE, JOLT, TORQUE_LIMIT, LEAST_KP, LEAST_KD = range(9, 18)
ORDINARY, SANE = 18, 22
"""First of the four rows of `ordinary`, and of the five of `sane`."""


def limit_table(limits: object) -> Array:
    """Return the (27, 27) table of `SafetyLimits`, read-only."""
    rows = [np.broadcast_to(np.asarray(getattr(limits, name), np.float64), NUM_JOINTS) for name in ROWS]
    blocks = [np.reshape(getattr(limits, name), (-1, NUM_JOINTS)) for name in ("ordinary", "sane")]
    table = np.concatenate((np.stack(rows), *blocks), dtype=np.float64)
    table.flags.writeable = False
    return table
