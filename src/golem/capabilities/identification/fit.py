"""Finds what one robot is like from its motion, and says what the motion does not tell.

Torques that the drives give are compared with inverse dynamics of the filtered motion, both through the same filter
(Gautier 1997), by Gauss-Newton with a prior. Samples near a standstill are left out: dry friction is undefined there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.signal import butter, sosfiltfilt

from golem.capabilities.identification.drives import find_delay, torque
from golem.capabilities.identification.recording import IdentificationError, Motion
from golem.capabilities.identification.regressor import (
    ARMATURE,
    BARE,
    DAMPING,
    FRICTION,
    MASSES,
    NAMES,
    NOMINAL,
    PRIOR,
    ZERO,
    HangingTree,
    Sample,
)
from golem.robots.model.table import JOINT_NAMES
from golem.types import NUM_JOINTS, TICK, Array

CUTOFF = 6.0
"""Of the filter [Hz]."""
_LOW = butter(4, CUTOFF, fs=1.0 / TICK, output="sos")
STRIDE = 10
"""Ticks between two samples that are used."""
SLOW = 0.04
"""Speed below which a joint is left out [rad/s], and for `AROUND` ticks before and after."""
AROUND = 50
ROUNDS = 4
RELATED = 1.0 / (2.0 * CUTOFF * STRIDE * TICK)
"""How many neighbouring samples of what the filter leaves say the same: the covariance is that much larger."""
ODD = 0.3
"""Share of a joint's torque, as standard deviations, that may be left unexplained."""
SCALE = 0.2
"""Standard deviation of a crane's scale [kg]."""
KNOWN = 0.5
"""Share of its prior's standard deviation to which what is known has to come down."""
ALIKE = 0.9
"""Cosine between the effects of two parameters that cannot be told apart."""


@dataclass(frozen=True, slots=True)
class Identified:
    """What was found.

    Attributes:
        x: (143,) parameters, see `regressor.NAMES`.
        sigma: (143,) their standard deviations.
        delay, delay_sigma: from a command to its torque [s].
        gain, gain_sigma: (27,) of the torques that the drives report.
        residual: (27,) torque that is left, root mean square [N m].
        unknown: what the motion does not tell, by name, each with why.
    """

    x: Array
    sigma: Array
    delay: float
    delay_sigma: float
    gain: Array
    gain_sigma: Array
    residual: Array
    unknown: dict[str, str]

    @property
    def ticks(self) -> int:
        """The delay in ticks, at which the drives of the twin act."""
        return max(round(self.delay / TICK), 0)


def low_passed(values: Array) -> Array:
    """Return `values` (n, ...), a row per tick, without what is faster than `CUTOFF`, and without a lag."""
    return sosfiltfilt(_LOW, values, axis=0)


def identify(motion: Motion, weight: float | None = None) -> Identified:
    """Identify the robot that moved.

    Args:
        motion: what it did.
        weight: its mass as a scale between hook and robot shows it, hands and payload included [kg].

    Raises:
        IdentificationError: the motion does not excite what every joint is to be known by; names the joints.
    """
    _check_moving(motion)
    delay, delay_sigma, gain, gain_sigma = find_delay(motion)
    q = low_passed(motion.q)
    gyro, acc = low_passed(motion.gyro), low_passed(motion.acc)
    dq, turn = np.gradient(q, TICK, axis=0), np.gradient(gyro, TICK, axis=0)
    ddq, spin, jerk = (np.gradient(values, TICK, axis=0) for values in (dq, turn, acc))
    columns = (q, dq, ddq, gyro, turn, spin, acc, jerk)
    # The filter's own beginning and end, half a second, are not used.
    rows = np.arange(250, len(q) - 250, STRIDE)
    samples = [Sample(*parts) for parts in zip(*(column[rows] for column in columns), strict=True)]
    given, rubbing = low_passed(torque(motion, delay))[rows], low_passed(np.sign(dq))[rows]
    used = ~maximum_filter1d(np.abs(dq) < SLOW, 2 * AROUND + 1, axis=0)[rows]
    own = np.stack([ddq[rows], dq[rows], rubbing], axis=2)

    tree, x, noise = HangingTree(), NOMINAL.copy(), np.full(NUM_JOINTS, 1.0)
    prior, H, data = 1.0 / PRIOR**2, np.zeros(0), np.zeros(0)
    own_at = [np.array([ARMATURE.start, DAMPING.start, FRICTION.start]) + j for j in range(NUM_JOINTS)]
    common_at = np.r_[0:30, ZERO, 138:143]
    for _ in range(ROUNDS):
        tree.load(x)
        lines = [tree.linearise(x, sample) for sample in samples]
        rigid, common = np.array([line[0] for line in lines]), np.array([line[1] for line in lines])
        data, pull = np.zeros((len(x), len(x))), -prior * (x - NOMINAL)
        for j in range(NUM_JOINTS):
            at, rows_j = np.r_[common_at, own_at[j]], used[:, j]
            A = np.hstack([common[rows_j, j], own[rows_j, j]])
            r = given[rows_j, j] - rigid[rows_j, j] - own[rows_j, j] @ x[own_at[j]]
            noise[j] = max(float(r @ r) / max(len(r), 1), 1e-6)
            data[np.ix_(at, at)] += A.T @ A / (noise[j] * RELATED)
            pull[at] += A.T @ r / (noise[j] * RELATED)
        if weight is not None:
            data[:30, :30] += np.outer(MASSES, MASSES) / SCALE**2
            pull[:30] += MASSES * (weight - BARE - MASSES @ x[:30]) / SCALE**2
        H = data + np.diag(prior)
        x = x + np.linalg.solve(H, pull)
    sigma = np.sqrt(np.diag(np.linalg.inv(H)))
    # With all else known; what all else leaves in doubt is a matter of `unknown`.
    alone = [np.sqrt(np.diag(np.linalg.inv(H[np.ix_(at, at)]))) / PRIOR[at] for at in own_at]
    if unexcited := [name for name, share in zip(JOINT_NAMES, alone, strict=True) if share.max() > KNOWN]:
        raise IdentificationError(_unexcited(unexcited))
    residual = np.sqrt(noise)
    asked = [given[used[:, j], j].std() for j in range(NUM_JOINTS)]
    if odd := [n for n, left, all_of_it in zip(JOINT_NAMES, residual, asked, strict=True) if left > ODD * all_of_it]:
        raise IdentificationError(
            f"The torques of {', '.join(odd)} are not those of a robot that hangs free: it is identified in the hoist, "
            "its feet clear of the floor, its limbs touching nothing."
        )
    unknown = _unknown(sigma, data)
    return Identified(x, sigma, delay * TICK, delay_sigma * TICK, gain, gain_sigma, residual, unknown)


def _check_moving(motion: Motion) -> None:
    """Refuse a motion in which a joint hardly moves: filters and fits of it would be of noise."""
    swing = np.percentile(motion.q, 95, axis=0) - np.percentile(motion.q, 5, axis=0)
    if still := [name for name, by in zip(JOINT_NAMES, swing, strict=True) if by < 0.05]:
        raise IdentificationError(_unexcited(still))


def _unexcited(joints: list[str]) -> str:
    which = "all 27 joints" if len(joints) == NUM_JOINTS else ", ".join(joints)
    return (
        f"The bag does not excite {which}: armature, damping and friction take motion at several speeds, as "
        "'golem identify NEW_BAG --motion' records."
    )


def _unknown(sigma: Array, data: Array) -> dict[str, str]:
    """Return which parameters stay as uncertain as they were, and why, from the information in the `data`."""
    size = np.sqrt(np.maximum(np.diag(data), 1e-300))
    alike = np.abs(data / np.outer(size, size))
    np.fill_diagonal(alike, 0.0)
    found: dict[str, str] = {}
    for i in np.flatnonzero(sigma > KNOWN * PRIOR):
        other = int(alike[i].argmax())
        if size[i] * PRIOR[i] < 1.0 / KNOWN:
            found[NAMES[i]] = "hardly changes any torque in this motion"
        elif alike[i, other] > ALIKE:
            found[NAMES[i]] = f"cannot be told from {NAMES[other]}"
        else:
            found[NAMES[i]] = "cannot be told from several others together"
    return found
