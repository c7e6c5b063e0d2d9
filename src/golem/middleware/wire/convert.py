"""The words of `golem.types` as the vendor's messages, and back.

A twin encodes states and decodes commands; a stack on the robot decodes states and encodes commands. What one refuses
to decode the other refuses to encode.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain

import numpy as np

from golem.middleware.dds.base import ENCAPSULATION, Payload
from golem.middleware.wire import hg
from golem.middleware.wire.hg import Checksum
from golem.middleware.wire.struct_layout import StructLayout, WireError
from golem.types import NUM_JOINTS, Array, Imu, LowCommand, LowState

MODE_MACHINE = 0
"""Machine type a twin reports [own: nobody publishes the H1-2's]; a client copies what the robot reports."""
_TICKS = 1000.0
"""Ticks per second: the vendor's simulator counts milliseconds (unitree_mujoco, simulate/src/unitree_sdk2_bridge.h)."""
_UNIT = 1e-3
"""How far from one the norm of a unit quaternion in single precision may be [own]."""
_LARGEST = 1e38
"""Bound on the size of what motors say or are told [own]: single precision ends at 3.4e38."""
_ON = bytes((hg.ENABLE,)) * NUM_JOINTS
_ALL_ON = bytes(hg.all_on())
_ZEROS = np.zeros(NUM_JOINTS)
_MEASURED = ("q", "dq", "ddq", "tau_est")
_TARGET = ("q", "dq", "tau", "kp", "kd")


def encode_low_state(state: LowState, mode_machine: int = MODE_MACHINE) -> bytes:
    """Return `state` as a `LowState_`; accelerations of the joints and temperatures are zero.

    Args:
        mode_machine: the machine type it reports.

    Raises:
        WireError: a value is not finite in single precision, the quaternion is none, or the time is negative.
    """
    quat, gyro, acc = state.imu.quat.tolist(), state.imu.gyro.tolist(), state.imu.acc.tolist()
    _check_imu(quat, gyro, acc, hg.LOW_STATE)
    motors = np.array((state.q, state.dq, _ZEROS, state.tau))
    _check_motors(motors, _MEASURED, hg.LOW_STATE)
    columns = ((hg.ENABLE,) * NUM_JOINTS, *motors.tolist())
    numbers = chain.from_iterable(zip(*columns, strict=True))
    head = ENCAPSULATION, hg.PR, mode_machine, _tick(state.t)
    payload = bytearray(hg.STATE_NUMBERS.pack(*head, *quat, *gyro, *acc, *rpy(state.imu.quat), 0, *numbers))
    hg.STATE_CHECKSUM.seal(payload)
    return bytes(payload)


def decode_low_state(payload: Payload) -> LowState:
    """Return the state in a `LowState_`. Its time is the robot's tick, which starts again after 49.7 days.

    Raises WireError: encapsulation, length or checksum is wrong, the ankles are not in pitch and roll, a value is not
    finite, or the quaternion is none.
    """
    _check(payload, hg.LOW_STATE, hg.STATE_CHECKSUM)
    mode_pr, tick, *inertial = hg.STATE_HEAD.unpack_from(payload)
    _check_ankles(mode_pr, "state")
    quat, gyro, acc = inertial[:4], inertial[4:7], inertial[7:]
    _check_imu(quat, gyro, acc, hg.LOW_STATE)
    motors = np.array(hg.state_motors(payload), dtype=np.float64)
    _check_motors(motors, _MEASURED, hg.LOW_STATE)
    q, dq, _, tau = motors
    return LowState(tick / _TICKS, q, dq, tau, Imu(np.array(quat), np.array(gyro), np.array(acc)))


def mode_machine(payload: Payload) -> int:
    """Return the machine type that a `LowState_` reports, for commands to it. Raises WireError: a wrong payload."""
    return int(hg.LOW_STATE.read(payload)["mode_machine"])


def motor_columns(payload: Payload) -> tuple[Array, Array, Array, Array]:
    """Return modes (27,), error words (27,), temperatures (27, 2) [degrees] and voltages (27,) [V] of a `LowState_`.

    The vendor's low-level examples report a `motorstate` other than zero as an error with that code; what the codes
    mean is not published. Raises WireError: encapsulation or length is wrong.
    """
    image = hg.LOW_STATE.read(payload)
    motors = image["motor"][:NUM_JOINTS]
    mode = motors["mode"].copy()
    mode[0] = image["first_mode"]
    return mode, motors["motorstate"], motors["temperature"], motors["vol"]


def encode_low_command(command: LowCommand, mode_machine: int, answers: float = 0.0) -> bytes:
    """Return `command` as a `LowCmd_` with the ankles in pitch and roll and all 27 motors on.

    Args:
        command: what the motors are told; its time is not sent.
        mode_machine: what the robot reports; it ignores other commands.
        answers: time of the state it was computed from [s], which GOLEM's safety gate reads from `reserve`; 0 for none.

    Raises:
        WireError: a value is not finite in single precision.
    """
    motors = np.array((command.q, command.dq, command.tau, command.kp, command.kd))
    _check_motors(motors, _TARGET, hg.LOW_CMD)
    payload = bytearray(_ALL_ON)
    hg.COMMAND_HEAD.pack_into(payload, len(ENCAPSULATION), hg.PR, mode_machine)
    hg.command_motors(payload)[:] = motors
    hg.ANSWERS.pack_into(payload, hg.ANSWERS_AT, _tick(answers))
    hg.COMMAND_CHECKSUM.seal(payload)
    return bytes(payload)


def decode_low_command(payload: Payload, t: float, mode_machine: int = MODE_MACHINE) -> LowCommand:
    """Return the command in a `LowCmd_`; a motor that is off gets zero gains and zero torque.

    Args:
        t: when [s]: the message does not say.
        mode_machine: the machine type this robot reports. Robots of this family silently ignore commands for another
            (users' reports on the G1: LeCAR-Lab/ASAP issue 81, NVlabs/GR00T-WholeBodyControl pull request 11).

    Raises:
        WireError: encapsulation, length or checksum is wrong, the ankles are not in pitch and roll, the machine type
            is another, or a value for a motor that is on is not finite.
    """
    _check(payload, hg.LOW_CMD, hg.COMMAND_CHECKSUM)
    mode_pr, machine = hg.COMMAND_HEAD.unpack_from(payload, len(ENCAPSULATION))
    _check_ankles(mode_pr, "command")
    if machine != mode_machine:
        raise WireError(
            f"The command has mode_machine {machine}, this robot reports {mode_machine}: copy it from the LowState."
        )
    motors = np.array(hg.command_motors(payload), dtype=np.float64)
    modes = hg.command_modes(payload)
    if modes != _ON:
        motors[:, np.frombuffer(modes, np.uint8) != hg.ENABLE] = 0.0
    _check_motors(motors, _TARGET, hg.LOW_CMD)
    return LowCommand(t, *motors)


def answered(payload: Payload) -> float:
    """Return the time of the state that a `LowCmd_` answers [s], 0 for none. Raises WireError: a wrong payload."""
    hg.LOW_CMD.check(payload)
    return hg.ANSWERS.unpack_from(payload, hg.ANSWERS_AT)[0] / _TICKS


def _check_ankles(mode_pr: int, what: str) -> None:
    if mode_pr != hg.PR:
        raise WireError(f"The {what} has mode_pr {mode_pr}; only {hg.PR} (ankle pitch and roll) is supported.")


def rpy(quat: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of a unit quaternion wxyz: yaw about z first, then pitch, then roll."""
    w, x, y, z = map(float, quat)
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(min(1.0, max(-1.0, 2.0 * (w * y - z * x))))
    return roll, pitch, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _check(payload: Payload, layout: StructLayout, checksum: Checksum) -> None:
    layout.check(payload)
    if not checksum.holds(payload):
        raise WireError(
            f"The checksum of a {layout.type_name} is {int.from_bytes(payload[-4:], 'little'):#010x}, "
            f"not {checksum.of(payload):#010x}: it was damaged, or its sender did not set it."
        )


def _tick(t: float) -> int:
    if not (math.isfinite(t) and t >= 0.0):
        raise WireError(f"A tick cannot say the time {t} s.")
    return round(t * _TICKS) % 2**32


def _check_motors(values: Array, names: Sequence[str], layout: StructLayout) -> None:
    """Refuse the values of motors, (n, 27) by their `names`, unless all are finite."""
    # Counting is the quickest question numpy answers.
    if np.count_nonzero(np.abs(values) <= _LARGEST) != values.size:
        column, motor = divmod(int(np.argmax(np.nan_to_num(np.abs(values), nan=np.inf))), NUM_JOINTS)
        raise WireError(
            f"{names[column]} of motor {motor} in a {layout.type_name} is {values[column, motor]}: "
            "not finite, or too large."
        )


def _check_imu(quat: list[float], gyro: list[float], acc: list[float], layout: StructLayout) -> None:
    if not math.hypot(*gyro, *acc) <= _LARGEST:
        raise WireError(f"The IMU in a {layout.type_name} is not finite: {gyro}, {acc}.")
    if not abs(math.hypot(*quat) - 1.0) <= _UNIT:
        raise WireError(f"The quaternion of the IMU in a {layout.type_name} is no unit quaternion: {quat}.")
