"""Compiled arithmetic of one look at life and plausibility; see `senses`."""

from __future__ import annotations

import math

import numpy as np

from golem.hardware.safety import limit_table as rows
from golem.kernels import njit
from golem.native import STATE
from golem.types import NUM_JOINTS, Array

FIRST = (0, 6, 12, 13, 20, 27)
"""First joint of each limb whose joints share a bus, and so a fate: legs, torso, arms; then how many there are."""
GROUPS = len(FIRST)
"""The limbs, and the IMU."""
DELAYS = 6
"""Looks over which a command may take to reach its motor: 50 ms."""
ASKED = 3 * DELAYS * NUM_JOINTS
"""Numbers of the commands of late: constant torque, stiffness, damping (`DELAYS`, 27) each, the oldest first."""
SCALARS = 2 * NUM_JOINTS + ASKED
"""Where the numbers that have no joint begin in what `looked` returns."""
_STILL = (1e-6, 1e-5, 1e-4)
"""Changes of orientation, rate [rad/s] and force [m/s^2] that no IMU's noise stays below [own: a hundredth of it]."""
_N, _D = NUM_JOINTS, DELAYS


@njit(cache=True)
def looked(
    numbers: Array,
    table: Array,
    dt: float,
    keep: float,
    share: float,
    lag: float,
    weak_load: float,
    weak_share: float,
    commanded: bool,
) -> Array:
    """Return what a look changes.

    Args:
        numbers: the state, the state looked at before (91 each); drift and dead (27 each); asked (486); q, dq, tau,
            kp, kd of the command; turn and force (3 each).
        dt: time between the two states [s].
        keep: share of the differences that is not forgotten.
        share: share of the new specific force in its mean.
        lag: delay between a joint's position and its speed that is no fault [s].
        weak_load: share of the torque limit above which a motor has to follow.
        weak_share: share of the torque asked for below which it does not.
        commanded: whether commands pass; else `dead` and `asked` stay as they are.

    Returns:
        drift and dead (27 each), asked (486), turn and force (3 each), the largest turning rate of the IMU, the largest
        drift beyond `lag`, the largest of `dead`, and 1 for each group that repeats its numbers, else 0.
    """
    out = np.zeros(SCALARS + 9 + GROUPS)
    drift_at = 2 * STATE
    dead_at, asked_at = drift_at + _N, drift_at + 2 * _N
    sent_at = asked_at + ASKED
    turn_at = sent_at + 5 * _N
    worst_drift, worst_dead, block = -math.inf, 0.0, _D * _N
    for i in range(_N):
        q, dq, tau = numbers[i], numbers[_N + i], numbers[2 * _N + i]
        speed = dq + numbers[STATE + _N + i]
        out[i] = numbers[drift_at + i]
        worst_drift = max(worst_drift, abs(out[i]) - lag * abs(speed))
        dead = numbers[dead_at + i]
        if commanded:
            s = sent_at + i
            kp, kd = numbers[s + 3 * _N], numbers[s + 4 * _N]
            newest = (kp * numbers[s] + kd * numbers[s + _N] + numbers[s + 2 * _N], kp, kd)
            least = math.inf
            for d in range(_D):
                k, old = 2 * _N + d * _N + i, asked_at + (d + 1) * _N + i
                for part in range(3):
                    out[k + part * block] = numbers[old + part * block] if d < _D - 1 else newest[part]
                least = min(least, abs(out[k] - out[k + block] * q - out[k + 2 * block] * dq))
            follows = not (least > weak_load * table[rows.TORQUE_LIMIT, i] and abs(tau) < weak_share * least)
            dead = 0.0 if follows else dead + dt
        out[_N + i] = dead
        worst_dead = max(worst_dead, dead)
    if not commanded:
        for i in range(ASKED):
            out[2 * _N + i] = numbers[asked_at + i]

    imu, old = 3 * _N, STATE + 3 * _N
    w, x, y, z = numbers[imu], numbers[imu + 1], numbers[imu + 2], numbers[imu + 3]
    pw, px, py, pz = numbers[old], numbers[old + 1], numbers[old + 2], numbers[old + 3]
    # For small angles: twice the vector part of the turn between the two orientations, less the mean rate's.
    scale = math.copysign(2.0, pw * w + px * x + py * y + pz * z)
    turned = (
        scale * (pw * x - px * w - py * z + pz * y),
        scale * (pw * y + px * z - py * w - pz * x),
        scale * (pw * z - px * y + py * x - pz * w),
    )
    rate = 0.0
    for i in range(3):
        gyro, before = numbers[imu + 4 + i], numbers[old + 4 + i]
        out[SCALARS + i] = keep * numbers[turn_at + i] + turned[i] - (0.5 * dt) * (before + gyro)
        force = numbers[turn_at + 3 + i]
        out[SCALARS + 3 + i] = force + share * (numbers[imu + 7 + i] - force)
        rate = max(rate, abs(gyro))
    out[SCALARS + 6], out[SCALARS + 7], out[SCALARS + 8] = rate, worst_drift, worst_dead

    for g in range(GROUPS):
        same = True
        if g < GROUPS - 1:
            for i in range(FIRST[g], FIRST[g + 1]):
                for k in (i, _N + i, 2 * _N + i):
                    same = same and numbers[k] == numbers[STATE + k]
        else:
            for k in range(imu, STATE):
                floor = _STILL[0] if k < imu + 4 else _STILL[1] if k < imu + 7 else _STILL[2]
                same = same and abs(numbers[k] - numbers[STATE + k]) <= floor
        out[SCALARS + 9 + g] = 1.0 if same else 0.0
    return out
