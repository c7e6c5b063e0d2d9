"""What encoders and drives of the motors report beside what is."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from golem.errors import ConfigError, unknown_name
from golem.robots.model.table import JOINT_INDEX
from golem.types import NUM_JOINTS, Array


@dataclass(frozen=True, slots=True)
class MotorErrors:
    """Magnitudes of the errors of a motor's report; zeros of the encoders are `arm_offset` and `leg_offset`.

    Attributes:
        encoder_step: least difference of two positions [rad].
        speed_noise: standard deviation of a speed, white at 500 Hz [rad/s].
        torque_noise: the same of a torque [N m].
        torque_gain: standard deviation of the share by which a joint's torques are wrong, constant over an episode.
        torque_gains: by joint the share about which it scatters; 0 where a joint is not named.
    """

    encoder_step: float = 0.0
    speed_noise: float = 0.0
    torque_noise: float = 0.0
    torque_gain: float = 0.0
    torque_gains: dict[str, float] = field(default_factory=dict[str, float])


def per_joint(values: object) -> Array:
    """Return the (27,) `values`, a mapping by joint, in motor order; 0 where a joint is not named.

    Raises:
        ConfigError: they are none, or one is no small number.
    """
    if not isinstance(values, dict):
        raise ConfigError(f"Zeros and torque gains are mappings by joint, not {values!r}.")
    out = np.zeros(NUM_JOINTS)
    for name, value in values.items():
        if name not in JOINT_INDEX:
            raise unknown_name("joint", name, JOINT_INDEX)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 0.5:
            raise ConfigError(f"The zero or torque gain of {name} is a number from -0.5 to 0.5, not {value!r}.")
        out[JOINT_INDEX[name]] = value
    return out
