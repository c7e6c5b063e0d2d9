"""Judges one sample of the robot's state: shape, finiteness, positions, speeds, torques, braking distance, tilt."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from golem.hardware.safety.base import EARLY, STANDING, Counters, SafetyLimits
from golem.hardware.safety.kernel import rate_state
from golem.interfaces.payloads import Fault, Reason
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, UPPER, Array, LowCommand, LowState

_ABSURD = 1e6
"""No joint position, speed, torque or gain has a number this large; below it nothing here can overflow."""
_SOUND, _STRAINED = Counters(), Counters(strained=True)
_SHAPES = [(NUM_JOINTS,), (NUM_JOINTS,), (NUM_JOINTS,), (4,), (3,), (3,)]
_KNOWN = (None, _STRAINED, _SOUND)
"""By `kernel.UNKNOWN`, `STRAINED` and `ORDINARY`."""


def finite(*arrays: Array, below: Array | float = _ABSURD) -> bool:
    """Return whether each array is (27,) and holds finite numbers of a size `below` a bound, by number or for all."""
    for array in arrays:
        if getattr(array, "shape", None) != (NUM_JOINTS,):
            return False
    joined = np.concatenate(arrays)
    return np.count_nonzero(np.abs(joined) < below) == joined.size


def whole(state: LowState) -> bool:
    """Return whether every array of `state` has its shape, every number is finite and the quaternion has length 1."""
    imu = state.imu
    if not finite(state.q, state.dq, state.tau):
        return False
    if imu.quat.shape != (4,) or imu.gyro.shape != (3,) or imu.acc.shape != (3,):
        return False
    w, x, y, z = imu.quat.tolist()
    rates = sum(map(abs, imu.gyro.tolist())) + sum(map(abs, imu.acc.tolist()))
    return 0.9 < w * w + x * x + y * y + z * z < 1.1 and rates < _ABSURD


def whole_command(command: LowCommand, below: Array | float = _ABSURD) -> bool:
    """Return whether every array of `command` is (27,), and finite and `below` a bound, one or (135,)."""
    return finite(command.q, command.dq, command.tau, command.kp, command.kd, below=below)


def quickly(state: LowState, before: Array, limits: SafetyLimits, jump: float) -> Counters | None:
    """Return the counters of a sample that is `whole`, has not jumped, and breaks no limit, in one call; else None.

    Args:
        before: (27,) positions of the sample before [rad].
        jump: how far a joint may have moved since then [rad].
    """
    imu = state.imu
    arrays = state.q, state.dq, state.tau, imu.quat, imu.gyro, imu.acc
    if [getattr(array, "shape", None) for array in arrays] != _SHAPES:
        return None
    numbers = np.concatenate((*arrays, before), dtype=np.float64)
    return _KNOWN[rate_state(numbers, limits.table, jump, math.cos(limits.tilt))]


def tilt(quat: Array) -> float:
    """Return the angle [rad] between the up axes of the world and of a frame with orientation `quat` (4,) wxyz."""
    w, x, y, z = quat.tolist()
    return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y) / (w * w + x * x + y * y + z * z))))


def at_rest(q: Array, dq: Array, deceleration: Array) -> Array:
    """Return where joints at `q` [rad] with `dq` [rad/s] come to rest if braked: dq^2 / (2 a) further on [rad]."""
    return q + dq * np.abs(dq) / (deceleration + deceleration)


def examine(state: LowState, limits: SafetyLimits, counters: Counters) -> tuple[Counters, Fault | None]:
    """Compare one new sample with the limits.

    Where a joint would come to rest must lie inside the range as well.

    Args:
        state: a sample that `whole` accepts.
        counters: consecutive bad samples before this one.

    Returns:
        The new counters, and the fault if one has persisted or is gross.
    """
    q, dq = state.q, state.dq
    count = np.count_nonzero
    rest = at_rest(q, dq, limits.deceleration)
    angle = tilt(state.imu.quat)
    away = q - limits.middle
    sizes = np.abs(np.concatenate((away, away + (rest - q) / EARLY, dq, state.tau)))
    if count(sizes < limits.ordinary) == sizes.size and angle <= limits.tilt:
        return _SOUND, None
    speed, load = np.abs(dq), np.abs(state.tau)
    quick = speed > limits.velocity
    beyond_range = (rest > limits.state_upper) | (rest < limits.state_lower)
    fast, over = count(quick), count(beyond_range)
    strong = count(load > limits.torque)
    outside = np.maximum(q - limits.state_upper, limits.state_lower - q)
    out = count(outside > 0.0)
    tilted = angle > limits.tilt
    if not (fast or strong or over or out or tilted):
        return _STRAINED, None

    new = Counters(
        position=counters.position + 1 if out and outside[UPPER].max() > 0.0 else 0,
        leg_position=counters.leg_position + 1 if out and outside[LEGS].max() > 0.0 else 0,
        velocity=counters.velocity + 1 if quick[UPPER].any() else 0,
        leg_velocity=counters.leg_velocity + 1 if quick[LEGS].any() else 0,
        torque=counters.torque + 1 if strong else 0,
        braking=counters.braking + 1 if beyond_range[UPPER].any() else 0,
        leg_braking=counters.leg_braking + 1 if beyond_range[LEGS].any() else 0,
        tilt=counters.tilt + 1 if tilted else 0,
        strained=True,
    )
    beyond = np.maximum(rest - limits.state_upper, limits.state_lower - rest)
    ratio = speed / limits.velocity
    n, legs = limits.samples, limits.leg_samples
    # What legs and torso have no part in leaves them able to stand; a leg may be wrong for a while, as in every step.
    bad = quick | beyond_range | (outside > 0.0)
    gross = max(float(ratio[LEGS].max()), float(outside[LEGS].max())) > limits.gross
    lasting = max(new.leg_position, new.leg_velocity, new.leg_braking) >= legs
    overloaded = bool((load > limits.torque)[STANDING].any())
    stands = not (tilted or gross or lasting or overloaded or bad[UPPER.start])
    if new.position >= n or new.leg_position >= legs or outside.max() > limits.gross:
        return new, Fault(Reason.POSITION, _worst(outside, lambda i: f"at {q[i]:.3f} rad"), stands)
    if fast and (new.velocity >= n or new.leg_velocity >= legs or ratio.max() > limits.gross):
        return new, Fault(Reason.VELOCITY, _worst(ratio, lambda i: f"at {dq[i]:.2f} rad/s"), stands)
    if new.braking >= n or new.leg_braking >= legs:
        return new, Fault(Reason.BRAKING, _worst(beyond, lambda i: f"at {q[i]:.3f} rad with {dq[i]:.2f} rad/s"), stands)
    if new.torque >= limits.torque_samples:
        return new, Fault(Reason.TORQUE, _worst(load / limits.torque, lambda i: f"at {state.tau[i]:.1f} N m"), stands)
    if new.tilt >= n:
        return new, Fault(Reason.TILT, f"torso at {math.degrees(angle):.0f} degrees")
    return new, None


def _worst(score: Array, text: Callable[[int], str]) -> str:
    joint = int(np.argmax(score))
    return f"{JOINT_NAMES[joint]} {text(joint)}"
