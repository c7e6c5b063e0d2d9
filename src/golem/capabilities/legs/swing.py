"""The stepping motion that a learned policy corrects instead of inventing it."""

from __future__ import annotations

import numpy as np

from golem.types import Array

LIFT = np.array([0.0, -1.0, 0.0, 2.0, -1.0, 0.0])
"""Shares of hip yaw, hip pitch, hip roll, knee, ankle pitch, ankle roll: they lift the foot and leave it level."""


def swing_offset(phase: Array, stance: float, amplitude: float) -> Array:
    """Return what swinging legs add to their joint targets [rad], (..., 12) in motor order.

    The foot rises and sinks with a half sine over the leg's swing, the part of the period after `stance`.

    Args:
        phase: (..., 2) gait phase of the left and the right leg, 0 to 1, stance first.
        stance: share of the period for which a foot stays on the ground, below 1.
        amplitude: peak of the hip's and the ankle's share; the knee bends by twice as much [rad].
    """
    swing = np.maximum(phase - stance, 0.0) / (1.0 - stance)
    bump = amplitude * np.sin(np.pi * swing)
    return (bump[..., None] * LIFT).reshape(*phase.shape[:-1], 12)
