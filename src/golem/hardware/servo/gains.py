"""Gains of the motor servo, one row per kind of joint; `gains.yaml`, beside this file, has each with its source."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.package_data import load_data
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


_ROWS: dict[str, list[float]] = load_data(__package__, "gains.yaml")


def default_gains() -> Gains:
    """Return the rows of the 27 motors."""
    kinds = [name.removesuffix("_joint").removeprefix("left_").removeprefix("right_") for name in JOINT_NAMES]
    table = np.array([_ROWS[kind] for kind in kinds])
    return Gains(*(table[:, column].copy() for column in range(4)))
