"""States, estimates and commands to and from the shared record of compiled stages; see `golem.native`."""

from __future__ import annotations

import numpy as np

from golem.native import COMMAND, STATE, Records
from golem.types import NUM_JOINTS, Array, BaseEstimate, Imu, LowCommand, LowState

_N = NUM_JOINTS
_QUAT, _GYRO, _ACC = 3 * _N, 3 * _N + 4, 3 * _N + 7


def state_of(numbers: Array, t: float) -> LowState:
    """Return the state of time `t` [s] that a copy of `numbers` (91,) holds; see `native.RECORD`."""
    x = numbers.copy()
    return LowState(t, x[:_N], x[_N : 2 * _N], x[2 * _N : _QUAT], Imu(x[_QUAT:_GYRO], x[_GYRO:_ACC], x[_ACC:STATE]))


def put_state(record: Records, state: LowState) -> None:
    """Write `state` into the shared record."""
    imu = state.imu
    np.concatenate((state.q, state.dq, state.tau, imu.quat, imu.gyro, imu.acc), out=record["state"][0])
    record["state_t"] = state.t


def command_of(numbers: Array, t: float) -> LowCommand:
    """Return the command of time `t` [s] that a copy of `numbers` (135,) holds; see `native.RECORD`."""
    return LowCommand(t, *numbers.reshape(5, _N).copy())


def put_command(numbers: Array, command: LowCommand) -> None:
    """Write `command` into `numbers` (135,)."""
    np.concatenate((command.q, command.dq, command.tau, command.kp, command.kd), out=numbers[:COMMAND])


def put_legs(record: Records, q: Array, gains: tuple[Array, Array] | None, tau: Array | None) -> None:
    """Write targets `q` (12,) of the legs, gains kp, kd and torques (12,) of their own if any, into the record."""
    row = record[0]
    row["has_legs"], row["has_leg_gains"], row["has_leg_tau"] = 1, gains is not None, tau is not None
    row["leg_q"] = q
    if gains is not None:
        row["leg_kp"], row["leg_kd"] = gains
    if tau is not None:
        row["leg_tau"] = tau


def base_of(record: Records) -> BaseEstimate:
    """Return the estimate of the base in the shared record."""
    row = record[0]
    return BaseEstimate(
        float(row["base_t"]),
        row["T_odom_base"].copy(),
        row["velocity"].copy(),
        float(row["height"]),
        row["contact"].copy(),
        bool(row["stale"]),
    )
