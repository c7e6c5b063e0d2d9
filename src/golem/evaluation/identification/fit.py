"""Finds what one robot is like from its motion, and says what the motion does not tell.

Torques that the drives give are compared with inverse dynamics of the filtered motion, both through the same filter
(Gautier 1997), by Gauss-Newton with a prior. Samples near a standstill are left out: dry friction is undefined there.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.signal import butter, sosfiltfilt

from golem.evaluation.identification import regressor as r
from golem.evaluation.identification.recording import IdentificationError, RecordedMotion
from golem.evaluation.identification.regressor import HangingTree
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.types import NUM_JOINTS, TICK, Array

CUTOFF, STRIDE, ROUNDS = 6.0, 10, 4
"""Of the filter [Hz]; ticks between two samples that are used; Gauss-Newton steps."""
SLOW, AROUND = 0.04, 50
"""Speed below which a joint is left out [rad/s], and how many ticks before and after, too."""
RELATED = 1.0 / (2.0 * CUTOFF * STRIDE * TICK)
"""How many neighbouring samples of what the filter leaves say the same: the covariance is that much larger."""
SCALE = 0.2
"""Standard deviation of a crane's scale [kg]."""
KNOWN, ALIKE, ODD = 0.5, 0.9, 0.3
"""What of the prior's standard deviation may be left of what is known; cosine between the effects of two parameters
that cannot be told apart; what of a joint's torque, as standard deviations, may be left unexplained."""
LONGEST_DELAY, LONGEST_REPORT = 60, 6
"""Most ticks from a command to its torque, and from a torque to its report."""
_LOW = butter(4, CUTOFF, fs=1.0 / TICK, output="sos")


@dataclass(frozen=True, slots=True)
class Identified:
    """What was found.

    Attributes:
        x, sigma: (143,) parameters, see `regressor.NAMES`, and their standard deviations.
        delay: from a command to its torque, in whole ticks [s].
        gain: (27,) of the torques that the drives report.
        unknown: what the motion does not tell, by name, each with why.
    """

    x: Array
    sigma: Array
    delay: float
    gain: Array
    unknown: dict[str, str]


def low_passed(values: Array) -> Array:
    """Return `values` (n, ...), a row per tick, without what is faster than `CUTOFF`, and without a lag."""
    return sosfiltfilt(_LOW, values, axis=0)


def torque(motion: RecordedMotion, delay: int) -> Array:
    """Return the (n, 27) torques [N m] that PD drives give, within their limits, to commands `delay` ticks old."""
    q, dq, tau, kp, kd = np.moveaxis(motion.command[np.maximum(np.arange(len(motion.q)) - delay, 0)], 1, 0)
    limit = load_limits().torque
    return np.clip(kp * (q - motion.q) + kd * (dq - motion.dq) + tau, -limit, limit)


def find_delay(motion: RecordedMotion) -> tuple[int, Array]:
    """Find by the torques that drives report, those that they give times a gain some ticks later, delay and gain (27,).

    Raises IdentificationError: drives report no torques, or the commands hardly change.
    """
    rows = np.arange(LONGEST_DELAY + LONGEST_REPORT + 1, len(motion.q), 7)
    said = motion.tau[rows]
    if dead := [name for name, spread in zip(JOINT_NAMES, said.std(axis=0), strict=True) if spread == 0.0]:
        raise IdentificationError(f"The bag has no torque of {', '.join(dead)}: their drives report none.")
    left, gains = np.empty((2, LONGEST_DELAY + 1, LONGEST_REPORT, NUM_JOINTS))
    given = said
    for d, s in np.ndindex(left.shape[:2]):
        given = torque(motion, d) if s == 0 else given
        late = given[rows - s]
        gains[d, s] = (late * said).sum(axis=0) / np.maximum((late**2).sum(axis=0), 1e-9)
        left[d, s] = ((said - gains[d, s] * late) ** 2).mean(axis=0)
    cost = len(rows) * (left / np.maximum(left.min(axis=(0, 1)), 1e-12)).sum(axis=2)
    best = np.unravel_index(int(cost.argmin()), cost.shape)
    others = np.delete(cost[:, best[1]], best[0])
    if others.min() - cost[best] < 25.0:  # five standard deviations
        raise IdentificationError("The bag does not excite the delay: its commands hardly change.")
    return int(best[0]), gains[best]


def identify(motion: RecordedMotion, weight: float | None = None) -> Identified:
    """Identify the robot that moved.

    Args:
        weight: its mass as a scale between hook and robot shows it, hands and payload included [kg].

    Raises:
        IdentificationError: the motion does not excite what every joint is to be known by; names the joints.
    """
    _refuse(np.percentile(motion.q, 95, axis=0) - np.percentile(motion.q, 5, axis=0) < 0.05)
    delay, gain = find_delay(motion)
    q, gyro, acc = low_passed(motion.q), low_passed(motion.gyro), low_passed(motion.acc)
    dq, turn = np.gradient(q, TICK, axis=0), np.gradient(gyro, TICK, axis=0)
    ddq, spin, jerk = (np.gradient(values, TICK, axis=0) for values in (dq, turn, acc))
    rows = np.arange(250, len(q) - 250, STRIDE)  # without the filter's own beginning and end
    samples = list(zip(*(values[rows] for values in (q, dq, ddq, gyro, turn, spin, acc, jerk)), strict=True))
    given, rubbing = low_passed(torque(motion, delay))[rows], low_passed(np.sign(dq))[rows]
    used = maximum_filter1d(np.abs(dq) < SLOW, 2 * AROUND + 1, axis=0)[rows] == 0
    own = np.stack([ddq[rows], dq[rows], rubbing], axis=2)

    tree, x, noise, prior = HangingTree(), r.NOMINAL.copy(), np.ones(NUM_JOINTS), np.diag(1.0 / r.PRIOR**2)
    own_at = [np.array([r.ARMATURE.start, r.DAMPING.start, r.FRICTION.start]) + j for j in range(NUM_JOINTS)]
    common_at, data = np.r_[0:30, r.ZERO, r.BIAS, r.LAG], np.zeros_like(prior)
    for _ in range(ROUNDS):
        tree.load(x)
        lines = [tree.linearise(x, *sample) for sample in samples]
        rigid, common = np.array([line[0] for line in lines]), np.array([line[1] for line in lines])
        data, pull = np.zeros_like(prior), -prior @ (x - r.NOMINAL)
        for j in range(NUM_JOINTS):
            at, k = np.r_[common_at, own_at[j]], used[:, j]
            A, left = np.hstack([common[k, j], own[k, j]]), (given[:, j] - rigid[:, j] - own[:, j] @ x[own_at[j]])[k]
            noise[j] = max(float(left @ left) / max(len(left), 1), 1e-6)
            data[np.ix_(at, at)] += A.T @ A / (noise[j] * RELATED)
            pull[at] += A.T @ left / (noise[j] * RELATED)
        if weight is not None:
            data[:30, :30] += np.outer(r.MASSES, r.MASSES) / SCALE**2
            pull[:30] += r.MASSES * (weight - r.BARE - r.MASSES @ x[:30]) / SCALE**2
        x = x + np.linalg.solve(data + prior, pull)
    asked = [given[used[:, j], j].std() for j in range(NUM_JOINTS)]
    if odd := [
        name for name, left, all_of_it in zip(JOINT_NAMES, noise, asked, strict=True) if left > (ODD * all_of_it) ** 2
    ]:
        raise IdentificationError(
            f"The torques of {', '.join(odd)} are not those of a robot that hangs free: it is identified in the hoist, "
            "its feet clear of the floor, its limbs touching nothing."
        )
    # With all else known; what all else leaves in doubt is a matter of `unknown`.
    alone = [np.linalg.inv((data + prior)[np.ix_(at, at)]) for at in own_at]
    _refuse([(np.sqrt(np.diag(c)) / r.PRIOR[at]).max() > KNOWN for c, at in zip(alone, own_at, strict=True)])
    sigma = np.sqrt(np.diag(np.linalg.inv(data + prior)))
    return Identified(x, sigma, delay * TICK, gain, _unknown(sigma, data))


def _refuse(unexcited: Iterable[bool]) -> None:
    """Name the joints that are `unexcited` (27,), if any is."""
    if which := [name for name, is_so in zip(JOINT_NAMES, unexcited, strict=True) if is_so]:
        raise IdentificationError(
            f"The bag does not excite {'all 27 joints' if len(which) == NUM_JOINTS else ', '.join(which)}: armature, "
            "damping and friction take motion at several speeds, as 'golem identify NEW_BAG --motion' records."
        )


def _unknown(sigma: Array, data: Array) -> dict[str, str]:
    """Return which parameters stay as uncertain as they were, and why, from the information in the `data`."""
    size = np.sqrt(np.maximum(np.diag(data), 1e-300))
    alike = np.abs(data / np.outer(size, size)) - np.eye(len(size))
    found: dict[str, str] = {}
    for i in np.flatnonzero(sigma > KNOWN * r.PRIOR):
        other = int(alike[i].argmax())
        if size[i] * r.PRIOR[i] < 1.0 / KNOWN:
            found[r.NAMES[i]] = "hardly changes any torque in this motion"
        else:
            what = r.NAMES[other] if alike[i, other] > ALIKE else "several others together"
            found[r.NAMES[i]] = f"cannot be told from {what}"
    return found
