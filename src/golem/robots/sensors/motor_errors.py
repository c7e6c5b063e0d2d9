"""What encoders and drives of the motors report beside what is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MotorErrors:
    """Magnitudes of the errors of a motor's report; zeros of the encoders are `arm_offset` and `leg_offset`.

    Attributes:
        encoder_step: least difference of two positions [rad].
        speed_noise: standard deviation of a speed, white at 500 Hz [rad/s].
        torque_noise: the same of a torque [N m].
        torque_gain: standard deviation of the share by which a joint's torques are wrong, constant over an episode.
    """

    encoder_step: float = 0.0
    speed_noise: float = 0.0
    torque_noise: float = 0.0
    torque_gain: float = 0.0
