"""What encoders and drives of the motors report beside what is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from golem.robots.model.table import JOINT_INDEX
from golem.types import NUM_JOINTS, Array


def per_joint(values: Mapping[str, float]) -> Array:
    """Return the (27,) `values` in motor order; 0 where a joint is not named."""
    out = np.zeros(NUM_JOINTS)
    for name, value in values.items():
        out[JOINT_INDEX[name]] = value
    return out


@dataclass(frozen=True, slots=True)
class MotorErrors:
    """Magnitudes of the errors of a motor's report; zeros of the encoders are `arm_offset` and `leg_offset`.

    Attributes:
        encoder_step: least difference of two positions [rad].
        speed_noise: standard deviation of a speed, white at 500 Hz [rad/s].
        torque_noise: the same of a torque [N m].
        torque_gain: standard deviation of the share by which a joint's torques are wrong, constant over an episode.
        torque_gains: shares by joint about which those scatter; 0 where a joint is not named.
    """

    encoder_step: float = 0.0
    speed_noise: float = 0.0
    torque_noise: float = 0.0
    torque_gain: float = 0.0
    torque_gains: dict[str, float] = field(default_factory=dict[str, float])
