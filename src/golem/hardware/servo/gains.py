"""Gains of the motor servo, one row per kind of joint, each with its source.

Legs: correlllab/HAMS walk.yaml, without integral: a leg that stands must not push against what holds it.

Torso and arms: correlllab/h12_ros2_controller (kp, kd, ki), the authors' own. They also publish kp 180/180/180/150/
150/50/50 with kd 3/3/3/3/3/2/2 (HAMS upper), which at the shoulder leaves a damping ratio of 0.2. Two changes of ours:
the wrists' kd is 4 instead of 8, which over-damped them (ratio 1.5 with 0.11 kg m^2) and made them lag by 0.1 s; and
their ki is 200 instead of 100, so that their bias settles as fast as the elbow's.

The clamp of the bias is 30 % of the URDF's torque limit for the arms (1 kg held at 0.6 m asks 6 of the shoulder's
12 N m) and 20 N m for the torso, which carries no gravity while the robot is upright.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.robots.model.table import JOINT_NAMES
from golem.types import Array


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of all motors, (27,) each.

    Attributes:
        kp: stiffness [N m/rad].
        kd: damping [N m s/rad].
        ki: integral gain [N m/(rad s)].
        bias: bound of the integral torque [N m].
    """

    kp: Array
    kd: Array
    ki: Array
    bias: Array


# kp, kd, ki, bias
_ROWS: dict[str, tuple[float, float, float, float]] = {
    "hip_yaw": (200.0, 2.5, 0.0, 0.0),
    "hip_pitch": (200.0, 2.5, 0.0, 0.0),
    "hip_roll": (200.0, 2.5, 0.0, 0.0),
    "knee": (300.0, 4.0, 0.0, 0.0),
    "ankle_pitch": (40.0, 2.0, 0.0, 0.0),
    "ankle_roll": (40.0, 2.0, 0.0, 0.0),
    "torso": (160.0, 10.0, 60.0, 20.0),
    "shoulder_pitch": (240.0, 12.0, 600.0, 12.0),
    "shoulder_roll": (200.0, 10.0, 600.0, 12.0),
    "shoulder_yaw": (150.0, 10.0, 400.0, 5.4),
    "elbow": (150.0, 8.0, 400.0, 5.4),
    "wrist_roll": (80.0, 4.0, 200.0, 5.7),
    "wrist_pitch": (80.0, 4.0, 200.0, 5.7),
    "wrist_yaw": (80.0, 4.0, 200.0, 5.7),
}


def default_gains() -> Gains:
    """Return the table above for the 27 motors."""
    kinds = [name.removesuffix("_joint").removeprefix("left_").removeprefix("right_") for name in JOINT_NAMES]
    table = np.array([_ROWS[kind] for kind in kinds])
    return Gains(*(table[:, column].copy() for column in range(4)))
