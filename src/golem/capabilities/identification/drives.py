"""What the drives do with a command: delay until it acts, and gain of the torque that they report."""

from __future__ import annotations

import numpy as np

from golem.capabilities.identification.recording import IdentificationError, Motion
from golem.robots.model.limits import load_limits
from golem.robots.model.table import JOINT_NAMES
from golem.types import TICK, Array

LONGEST_DELAY, LONGEST_REPORT = 60, 6
"""Most ticks from a command to its torque, and from a torque to its report."""
_EVERY = 7
"""Share of the ticks that the delay is found from."""


def torque(motion: Motion, delay: float) -> Array:
    """Return the (n, 27) torque [N m] that PD drives give: kp (q_c - q) + kd (dq_c - dq) + tau, within their limits.

    Args:
        motion: states and commands.
        delay: age of the command that acts [ticks]; a share of a tick mixes two commands.
    """
    whole = int(np.floor(delay))
    first, second = (_torque(motion, whole + k) for k in (0, 1))
    return first + (delay - whole) * (second - first)


def _torque(motion: Motion, delay: int) -> Array:
    old = motion.command[np.maximum(np.arange(len(motion.q)) - delay, 0)]
    q, dq, tau, kp, kd = np.moveaxis(old, 1, 0)
    limit = load_limits().torque
    return np.clip(kp * (q - motion.q) + kd * (dq - motion.dq) + tau, -limit, limit)


def find_delay(motion: Motion) -> tuple[float, float, Array, Array]:
    """Find the delay by the torques that the drives report, which are those that they give, times a gain, later.

    Returns:
        The delay [ticks] and its standard deviation, (27,) gain of each joint's report and its standard deviation.

    Raises:
        IdentificationError: the drives report no torques, or the commands hardly change.
    """
    rows = np.arange(LONGEST_DELAY + LONGEST_REPORT + 1, len(motion.q), _EVERY)
    said = motion.tau[rows]
    if dead := [name for name, spread in zip(JOINT_NAMES, said.std(axis=0), strict=True) if spread == 0.0]:
        raise IdentificationError(f"The bag has no torque of {', '.join(dead)}: their drives report none.")
    by_delay = [_torque(motion, d) for d in range(LONGEST_DELAY + 1)]

    def left(d: int, report: int) -> tuple[Array, Array]:
        """Return what is left of each joint's reports, and the gains."""
        given = by_delay[d][rows - report]
        gain = (given * said).sum(axis=0) / np.maximum((given * given).sum(axis=0), 1e-9)
        return ((said - gain * given) ** 2).sum(axis=0), gain

    table = np.array([[left(d, s)[0] for s in range(LONGEST_REPORT)] for d in range(LONGEST_DELAY + 1)])
    noise = np.maximum(table.min(axis=(0, 1)), 1e-12) / len(rows)
    cost = (table / noise).sum(axis=2)
    best, report = np.unravel_index(int(cost.argmin()), cost.shape)
    around = cost[max(best - 1, 0) : best + 2, report]
    curve = float(np.abs(np.diff(around, 2)).sum()) if len(around) == 3 else 2.0 * abs(float(around[1] - around[0]))
    shift = 0.5 * float(around[0] - around[2]) / curve if len(around) == 3 and curve > 0.0 else 0.0
    sigma = np.sqrt(2.0 / max(curve, 1e-12))
    if sigma * TICK > 1e-3:
        raise IdentificationError("The bag does not excite the delay: its commands hardly change.")
    given = by_delay[best][rows - report]
    gain = left(int(best), int(report))[1]
    return float(best) + shift, float(sigma), gain, np.sqrt(noise / np.maximum((given**2).sum(axis=0), 1e-9))
