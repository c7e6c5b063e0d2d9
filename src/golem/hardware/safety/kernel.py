"""Compiled arithmetic of the gate: the limiter, and what answers for samples and commands that are ordinary.

Compiled at the first call, then cached on disk. Every function is called with the arrays that this package makes, one
contiguous float64 array of numbers by motor, so that nothing is ever compiled for another type in the middle of a tick.
`table` is `SafetyLimits.table`, see `limit_table`.
"""

from __future__ import annotations

import math

import numpy as np

from golem.hardware.safety import limit_table as rows
from golem.hardware.safety.base import EARLY, EASE, SPACE
from golem.kernels import njit
from golem.native import COMMAND, STATE
from golem.types import LEGS, NUM_JOINTS, Array

BRAKE = 0.5
"""Share of the torque bound that brakes a joint which is too fast, or would come to rest beyond its range [own]."""
UNKNOWN, STRAINED, ORDINARY = 0, 1, 2
"""What is known of a sample: nothing; it is whole, has not jumped and breaks no limit; nor is any joint strained."""
MOST = 1e5
"""Sum of the rates [rad/s] and specific forces [m/s^2] that an ordinary sample stays below."""
SLACK = 0.01
"""Share of a motor's torque below which a feed-forward carries nothing [own]."""
_N = NUM_JOINTS
_UPPER = LEGS.stop


@njit(cache=True)
def limited(numbers: Array, table: Array, dt: float, loaded: bool, strained: bool) -> Array:
    """Return what `limiter.limit_command` does: q, dq, tau, kp, kd to be sent, then q, kp, kd, tau to be remembered.

    Args:
        numbers: (297,) the command; q and dq as measured; q, kp, kd, tau of the last command.
        dt: time since the last command [s].
        loaded: whether the last feed-forward bounds the new one.
        strained: whether joints are braked.

    Returns:
        (9, 27).
    """
    out = np.empty((9, _N))
    for i in range(_N):
        q, dq, tau, kp, kd = (
            numbers[i],
            numbers[_N + i],
            numbers[2 * _N + i],
            numbers[3 * _N + i],
            numbers[4 * _N + i],
        )
        at, moving = numbers[5 * _N + i], numbers[6 * _N + i]
        last_q, last_kp, last_kd, last_tau = (
            numbers[7 * _N + i],
            numbers[8 * _N + i],
            numbers[9 * _N + i],
            numbers[10 * _N + i],
        )
        bound, velocity, slew = table[rows.TORQUE, i], table[rows.VELOCITY, i], table[rows.SLEW, i]
        highest, lowest = bound, -bound
        if strained:
            early = EARLY * table[rows.DECELERATION, i]
            rest, ease = at + moving * abs(moving) / (early + early), EASE * velocity
            up = min((velocity - moving) / ease, (table[rows.STATE_UPPER, i] - rest) / SPACE)
            down = min((velocity + moving) / ease, (rest - table[rows.STATE_LOWER, i]) / SPACE)
            highest = min(max(up, -BRAKE), 1.0) * bound
            lowest = -min(max(down, -BRAKE), 1.0) * bound

        kp = min(min(max(kp, 0.0), table[rows.KP_MAX, i]), last_kp + table[rows.KP_RATE, i] * dt)
        kd = min(min(max(kd, 0.0), table[rows.KD_MAX, i]), last_kd + table[rows.KD_RATE, i] * dt)

        twice = table[rows.DECELERATION, i] + table[rows.DECELERATION, i]
        rise = min(math.sqrt(twice * max(table[rows.UPPER, i] - last_q, 0.0)), slew) * dt
        fall = min(math.sqrt(twice * max(last_q - table[rows.LOWER, i], 0.0)), slew) * dt
        q = min(max(q, table[rows.LOWER, i]), table[rows.UPPER, i])
        q = min(max(q, last_q - fall), last_q + rise)

        dq = min(max(dq, -velocity), velocity)
        damp = kd * (dq - moving)
        share = bound / max(abs(damp), bound)
        damp *= share
        tau = min(max(tau, -bound), bound)
        if loaded:
            step = table[rows.TORQUE_RATE, i] * dt
            tau = min(max(tau, last_tau - step), last_tau + step)
        constant = min(max(tau + damp, lowest), highest)
        soft = max(kp, 1e-9)
        center = at - constant / soft
        q = min(max(q, center + lowest / soft), center + highest / soft)
        out[0, i], out[1, i], out[2, i], out[3, i], out[4, i] = q, dq, constant - damp, kp, kd * share
        out[5, i], out[6, i], out[7, i], out[8, i] = q, kp, kd, tau
    return out


@njit(cache=True)
def rate_state(numbers: Array, table: Array, jump: float, upright: float) -> int:
    """Return what is known of a sample: `UNKNOWN`, `STRAINED` or `ORDINARY`.

    Args:
        numbers: (118,) the state, then q of the sample before.
        jump: how far a joint may have moved since [rad].
        upright: least cosine of the torso's tilt.
    """
    known = ORDINARY
    for i in range(_N):
        q, dq, tau = numbers[i], numbers[_N + i], numbers[2 * _N + i]
        away, braking = q - table[rows.MIDDLE, i], table[rows.DECELERATION, i]
        rest = q + dq * abs(dq) / (braking + braking)
        if not abs(q - numbers[STATE + i]) <= jump:
            return UNKNOWN
        if not (
            abs(away) < table[rows.ORDINARY, i]
            and abs(away + (rest - q) / EARLY) < table[rows.ORDINARY + 1, i]
            and abs(dq) < table[rows.ORDINARY + 2, i]
            and abs(tau) < table[rows.ORDINARY + 3, i]
        ):
            known = STRAINED
            upper, lower = table[rows.STATE_UPPER, i], table[rows.STATE_LOWER, i]
            if not (
                lower <= q <= upper
                and lower <= rest <= upper
                and abs(dq) <= table[rows.VELOCITY, i]
                and abs(tau) <= table[rows.TORQUE_LIMIT, i]
            ):
                return UNKNOWN
    k = 3 * _N
    w, x, y, z = numbers[k], numbers[k + 1], numbers[k + 2], numbers[k + 3]
    norm, rates = w * w + x * x + y * y + z * z, 0.0
    for i in range(k + 4, STATE):
        rates += abs(numbers[i])
    upright_now = 0.9 < norm < 1.1 and 1.0 - 2.0 * (x * x + y * y) / norm > upright
    return known if upright_now and rates < MOST else UNKNOWN


@njit(cache=True)
def ordinary_command(numbers: Array, table: Array, one: float, constants: float, all_: float) -> bool:
    """Return whether a command, after another, is one that `sender.examine_command` has nothing against.

    Args:
        numbers: (270,) the command, then the one before it.
        one: most that may be asked of a leg's motor beyond the last command, in shares of its torque limit.
        constants: the same of the constant torques of the legs' motors together.
        all_: the same of the legs' motors together.
    """
    for k in range(5):
        for i in range(_N):
            if not abs(numbers[k * _N + i]) < table[rows.SANE + k, i]:
                return False
    thrown, constant = 0.0, 0.0
    for i in range(_N):
        kp, kd = numbers[3 * _N + i], numbers[4 * _N + i]
        if not (kd >= table[rows.LEAST_KD, i] and kp >= 0.0):
            return False
        soft = kp < table[rows.LEAST_KP, i] and abs(numbers[2 * _N + i]) <= SLACK * table[rows.TORQUE_LIMIT, i]
        if soft and i < _UPPER:
            return False
        jump = numbers[2 * _N + i] - numbers[COMMAND + 2 * _N + i]
        spring = kp * (numbers[i] - numbers[COMMAND + i])
        if i < _UPPER:
            most = table[rows.TORQUE_LIMIT, i]
            steady = jump + kd * (numbers[_N + i] - numbers[COMMAND + _N + i])
            asked = abs(steady + spring)
            if not asked <= one * most:
                return False
            if not abs(steady) <= one * most:
                return False
            thrown += asked / most
            constant += abs(steady) / most
        else:
            jump += spring
        if not abs(jump) <= table[rows.JOLT, i]:
            return False
    return thrown <= all_ and constant <= constants
