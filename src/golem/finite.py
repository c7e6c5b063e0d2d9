"""Refuses measurements that are not finite where they would stay: in a filter, an integral, a pose to go to."""

from __future__ import annotations

import math

import numpy as np

from golem.errors import GolemError
from golem.types import Array, LowState


class NotFinite(GolemError):
    """A module was given NaN or infinity."""


def check_finite(name: str, values: Array) -> None:
    """Refuse `values`, called `name`, unless all are finite.

    Raises:
        NotFinite: one is not.
    """
    # A product with itself costs a third of isfinite and all, and is finite unless something is not (or is huge).
    if not math.isfinite(np.vdot(values, values)) and not np.isfinite(values).all():
        raise NotFinite(f"{name} holds NaN or infinity.")


def check_measured(state: LowState) -> None:
    """Refuse a `state` whose joints or IMU report what is not finite.

    Raises:
        NotFinite: they do; names which.
    """
    imu = state.imu
    check_finite("q", state.q)
    check_finite("dq", state.dq)
    check_finite("the IMU's quaternion", imu.quat)
    check_finite("the IMU's gyro", imu.gyro)
    check_finite("the IMU's acceleration", imu.acc)
