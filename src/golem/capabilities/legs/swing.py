"""The stepping motion that a learned policy corrects instead of inventing it."""

from __future__ import annotations

import math

import numpy as np

from golem.kernels import njit
from golem.types import Array

LIFT = np.array([0.0, -1.0, 0.0, 2.0, -1.0, 0.0])
"""Shares of hip yaw, hip pitch, hip roll, knee, ankle pitch, ankle roll: they lift the foot and leave it level."""


def swing_share(phase: Array, stance: float) -> Array:
    """Return how much of its swing a leg at `phase` (0 to 1) has done; 0 in stance, which comes first."""
    return np.maximum(phase - stance, 0.0) / (1.0 - stance)


def rise(swing: Array) -> Array:
    """Return sin^2 of a swing that runs from 0 to 1: 1 in its middle, at rest at both ends."""
    return np.square(np.sin(np.pi * swing))


@njit(cache=True, nogil=True)
def swing_legs(phase: Array, period: float, stance: float, amplitude: float, lag: Array, out: Array) -> None:
    """Write what `swing_offset` returns of one robot into `out` (12,)."""
    for k in range(2):
        swing = max(phase[k] - stance, 0.0) / (1.0 - stance)
        lift = math.sin(math.pi * swing)
        speed = math.pi / ((1.0 - stance) * period) * math.sin(2.0 * math.pi * swing)
        for i in range(6):
            out[6 * k + i] = amplitude * (lift * lift + speed * lag[6 * k + i]) * LIFT[i]


@njit(cache=True, nogil=True)
def _swing_all(phase: Array, period: float, stance: float, amplitude: float, lag: Array, out: Array) -> None:
    for i in range(len(phase)):
        swing_legs(phase[i], period, stance, amplitude, lag, out[i])


def swing_offset(phase: Array, period: float, stance: float, amplitude: float, lag: Array) -> Array:
    """Return what swinging legs add to their joint targets [rad], (..., 12) in motor order.

    The foot rises and sinks over the leg's swing, the part of the period after `stance`, and is at rest at both ends:
    with a half sine it came down at 0.8 m/s, heel first. Targets lead by what damping holds the joints back, so that
    soft ankles keep up with hips and knees and the foot stays level.

    Args:
        phase: (..., 2) gait phase of the left and the right leg, 0 to 1, stance first.
        period: of the gait [s].
        stance: share of the period for which a foot stays on the ground, below 1.
        amplitude: peak of the hip's and the ankle's share; the knee bends by twice as much [rad].
        lag: (12,) how far each joint follows behind its target, kd / kp [s].
    """
    out = np.empty((*phase.shape[:-1], 12))
    rows = np.ascontiguousarray(phase).reshape(-1, 2)
    _swing_all(rows, period, stance, amplitude, np.ascontiguousarray(lag), out.reshape(-1, 12))
    return out
