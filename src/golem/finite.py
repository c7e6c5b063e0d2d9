"""Refuses measurements that are not finite where they would stay: in a filter, an integral, a pose to go to."""

from __future__ import annotations

import math

import numpy as np

from golem.errors import GolemError
from golem.kernels import njit
from golem.native import Record
from golem.types import Array, LowState


class NotFinite(GolemError):
    """A module was given NaN or infinity."""


def check_finite(name: str, values: Array) -> None:
    """Refuse `values`, called `name`, unless all are finite. Raises NotFinite: one is not."""
    # A product with itself costs a third of isfinite and all, and is finite unless something is not (or is huge).
    if not math.isfinite(np.vdot(values, values)) and not np.isfinite(values).all():
        raise NotFinite(f"{name} holds NaN or infinity.")


def check_measured(state: LowState) -> None:
    """Refuse a `state` whose joints or IMU report what is not finite. Raises NotFinite: they do; names which."""
    imu = state.imu
    check_finite("q", state.q)
    check_finite("dq", state.dq)
    check_finite("the IMU's quaternion", imu.quat)
    check_finite("the IMU's gyro", imu.gyro)
    check_finite("the IMU's acceleration", imu.acc)


@njit(cache=True, nogil=True)
def finite_state(r: Record) -> bool:
    """Return whether joints and IMU of the shared record are finite, as `check_measured` asks; torques may be any."""
    total = 0.0  # x - x is 0, or NaN
    for i in range(len(r.q)):
        total += (r.q[i] - r.q[i]) + (r.dq[i] - r.dq[i])
    for i in range(3):
        total += (r.gyro[i] - r.gyro[i]) + (r.acc[i] - r.acc[i])
    for i in range(4):
        total += r.quat[i] - r.quat[i]
    return total == 0.0
