"""What the drives do with a command: delay until it acts, and gain of the torque that they report."""

from __future__ import annotations

import numpy as np

from golem.capabilities.identification.recording import IdentificationError, Motion
from golem.robots.model.limits import load_limits
from golem.robots.model.table import JOINT_NAMES
from golem.types import Array

LONGEST_DELAY, LONGEST_REPORT = 60, 6
"""Most ticks from a command to its torque, and from a torque to its report."""


def torque(motion: Motion, delay: int) -> Array:
    """Return the (n, 27) torques [N m] that PD drives give, within their limits, to commands `delay` ticks old."""
    q, dq, tau, kp, kd = np.moveaxis(motion.command[np.maximum(np.arange(len(motion.q)) - delay, 0)], 1, 0)
    limit = load_limits().torque
    return np.clip(kp * (q - motion.q) + kd * (dq - motion.dq) + tau, -limit, limit)


def find_delay(motion: Motion) -> tuple[float, Array, Array]:
    """Find the delay by the torques that the drives report: those that they give, times a gain, some ticks later.

    Returns:
        The delay [ticks], (27,) gain of each joint's report, and its standard deviation.

    Raises:
        IdentificationError: drives report no torques, or the commands hardly change.
    """
    rows = np.arange(LONGEST_DELAY + LONGEST_REPORT + 1, len(motion.q), 7)
    said = motion.tau[rows]
    if dead := [name for name, spread in zip(JOINT_NAMES, said.std(axis=0), strict=True) if spread == 0.0]:
        raise IdentificationError(f"The bag has no torque of {', '.join(dead)}: their drives report none.")
    left = np.empty((LONGEST_DELAY + 1, LONGEST_REPORT, len(JOINT_NAMES)))
    gains, power = np.empty_like(left), np.empty_like(left)
    for d in range(LONGEST_DELAY + 1):
        all_given = torque(motion, d)
        for s in range(LONGEST_REPORT):
            given = all_given[rows - s]
            power[d, s] = np.maximum((given**2).sum(axis=0), 1e-9)
            gains[d, s] = (given * said).sum(axis=0) / power[d, s]
            left[d, s] = ((said - gains[d, s] * given) ** 2).mean(axis=0)
    noise = np.maximum(left.min(axis=(0, 1)), 1e-12)
    cost = len(rows) * (left / noise).sum(axis=2)
    best = np.unravel_index(int(cost.argmin()), cost.shape)
    before, least, after = cost[np.abs(int(best[0]) + np.array([-1, 0, 1])).clip(max=LONGEST_DELAY), best[1]]
    curve = float(before - 2.0 * least + after)
    if curve < 100.0:  # a standard deviation of a seventh of a tick
        raise IdentificationError("The bag does not excite the delay: its commands hardly change.")
    shift = 0.5 * float(before - after) / curve
    return float(best[0]) + shift, gains[best], np.sqrt(noise / power[best])
