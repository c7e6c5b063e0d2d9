"""The words of `golem.types` as the vendor's messages, and back.

A twin encodes states and decodes commands; a stack on the robot decodes states and encodes commands. What one refuses
to decode the other refuses to encode.
"""

from __future__ import annotations

import math

import numpy as np

from golem.middleware.dds.base import Payload
from golem.middleware.wire import hg
from golem.middleware.wire.crc import Checksum
from golem.middleware.wire.layout import Image, Layout, WireError
from golem.types import NUM_JOINTS, Array, Imu, LowCommand, LowState

MODE_MACHINE = 0
"""Machine type a twin reports [own: nobody publishes the H1-2's]; a client copies what the robot reports."""
_TICKS = 1000.0
"""Ticks per second: the vendor's simulator counts milliseconds (unitree_mujoco, simulate/src/unitree_sdk2_bridge.h)."""
_UNIT = 1e-3
"""How far from one the norm of a unit quaternion in single precision may be [own]."""


def _enabled(layout: Layout) -> bytes:
    """Return a payload of `layout` whose used motors are on."""
    payload = layout.blank()
    image = layout.read(payload)
    image["first_mode"] = hg.ENABLE
    image["motor"]["mode"][1:NUM_JOINTS] = hg.ENABLE
    return bytes(payload)


_STATE = _enabled(hg.LOW_STATE)
_COMMAND = _enabled(hg.LOW_CMD)


def encode_low_state(state: LowState, mode_machine: int = MODE_MACHINE) -> bytes:
    """Return `state` as a `LowState_`; accelerations of the joints and temperatures are zero.

    Args:
        state: what the robot measures.
        mode_machine: the machine type it reports.

    Raises:
        WireError: a value is not finite in single precision, or the time is negative.
    """
    payload = bytearray(_STATE)
    image = hg.LOW_STATE.read(payload)
    image["mode_machine"] = mode_machine
    image["tick"] = _tick(state.t)
    measured = image["motor"]["measured"][:NUM_JOINTS]
    with np.errstate(over="ignore"):
        measured[:, 0] = state.q
        measured[:, 1] = state.dq
        measured[:, 3] = state.tau
    _check_motors(measured, ("q", "dq", "ddq", "tau_est"), hg.LOW_STATE)
    _fill_imu(image["imu"], state.imu, hg.LOW_STATE)
    hg.STATE_CHECKSUM.seal(payload)
    return bytes(payload)


def decode_low_state(payload: Payload) -> LowState:
    """Return the state in a `LowState_`. Its time is the robot's tick, which starts again after 49.7 days.

    Raises:
        WireError: encapsulation, length or checksum is wrong, a value is not finite, or the quaternion is none.
    """
    image = _checked(payload, hg.LOW_STATE, hg.STATE_CHECKSUM)
    measured = image["motor"]["measured"][:NUM_JOINTS]
    _check_motors(measured, ("q", "dq", "ddq", "tau_est"), hg.LOW_STATE)
    q, dq, _, tau = measured.T.astype(np.float64, order="C")
    return LowState(int(image["tick"]) / _TICKS, q, dq, tau, _read_imu(image["imu"], hg.LOW_STATE))


def mode_machine(payload: Payload) -> int:
    """Return the machine type that a `LowState_` reports, for the commands to the robot that sent it.

    Raises:
        WireError: encapsulation or length is wrong.
    """
    return int(hg.LOW_STATE.read(payload)["mode_machine"])


def encode_low_command(command: LowCommand, mode_machine: int, answers: float = 0.0) -> bytes:
    """Return `command` as a `LowCmd_` with the ankles in pitch and roll and all 27 motors on.

    Args:
        command: what the motors are told; its time is not sent.
        mode_machine: what the robot reports; it ignores other commands.
        answers: time of the state it was computed from [s], which GOLEM's safety gate reads from `reserve`; 0 for none.

    Raises:
        WireError: a value is not finite in single precision.
    """
    payload = bytearray(_COMMAND)
    image = hg.LOW_CMD.read(payload)
    image["mode_machine"] = mode_machine
    image["reserve"][0] = _tick(answers)
    target = image["motor"]["target"][:NUM_JOINTS]
    with np.errstate(over="ignore"):
        target[:, 0] = command.q
        target[:, 1] = command.dq
        target[:, 2] = command.tau
        target[:, 3] = command.kp
        target[:, 4] = command.kd
    _check_motors(target, ("q", "dq", "tau", "kp", "kd"), hg.LOW_CMD)
    hg.COMMAND_CHECKSUM.seal(payload)
    return bytes(payload)


def decode_low_command(payload: Payload, t: float, mode_machine: int = MODE_MACHINE) -> LowCommand:
    """Return the command in a `LowCmd_`; a motor that is off gets zero gains and zero torque.

    Args:
        payload: what was received.
        t: when [s]: the message does not say.
        mode_machine: the machine type this robot reports. Robots of this family silently ignore commands for another
            (users' reports on the G1: LeCAR-Lab/ASAP issue 81, NVlabs/GR00T-WholeBodyControl pull request 11).

    Raises:
        WireError: encapsulation, length or checksum is wrong, the ankles are not in pitch and roll, the machine type
            is another, or a value for a motor that is on is not finite.
    """
    image = _checked(payload, hg.LOW_CMD, hg.COMMAND_CHECKSUM)
    if image["mode_pr"] != hg.PR:
        raise WireError(
            f"The command has mode_pr {image['mode_pr']}; only {hg.PR} (ankle pitch and roll) is supported."
        )
    if image["mode_machine"] != mode_machine:
        raise WireError(
            f"The command has mode_machine {image['mode_machine']}, this robot reports {mode_machine}: "
            "copy it from the LowState."
        )
    motor = image["motor"][:NUM_JOINTS]
    target = motor["target"].copy()
    off = motor["mode"] != hg.ENABLE
    off[0] = image["first_mode"] != hg.ENABLE
    target[off] = 0.0
    _check_motors(target, ("q", "dq", "tau", "kp", "kd"), hg.LOW_CMD)
    return LowCommand(t, *target.T.astype(np.float64, order="C"))


def answered(payload: Payload) -> float:
    """Return the time of the state that a `LowCmd_` answers [s]; 0 where its sender does not say.

    Raises:
        WireError: encapsulation or length is wrong.
    """
    return int(hg.LOW_CMD.read(payload)["reserve"][0]) / _TICKS


def encode_imu(imu: Imu) -> bytes:
    """Return `imu` as an `IMUState_`.

    Raises:
        WireError: a value is not finite, or the quaternion is none.
    """
    payload = hg.IMU_STATE.blank()
    _fill_imu(hg.IMU_STATE.read(payload), imu, hg.IMU_STATE)
    return bytes(payload)


def decode_imu(payload: Payload) -> Imu:
    """Return the sample in an `IMUState_`.

    Raises:
        WireError: encapsulation or length is wrong, a value is not finite, or the quaternion is none.
    """
    return _read_imu(hg.IMU_STATE.read(payload), hg.IMU_STATE)


def rpy(quat: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of a unit quaternion wxyz: yaw about z first, then pitch, then roll."""
    w, x, y, z = map(float, quat)
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(min(1.0, max(-1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


def _checked(payload: Payload, layout: Layout, checksum: Checksum) -> Image:
    image = layout.read(payload)
    if not checksum.holds(payload):
        raise WireError(
            f"The checksum of a {layout.type_name} is {int(image['crc']):#010x}, "
            f"not {checksum.of(payload):#010x}: it was damaged, or its sender did not set it."
        )
    return image


def _tick(t: float) -> int:
    if not (math.isfinite(t) and t >= 0.0):
        raise WireError(f"A tick cannot say the time {t} s.")
    return round(t * _TICKS) % 2**32


def _check_motors(values: np.ndarray, names: tuple[str, ...], layout: Layout) -> None:
    """Refuse (27, len(names)) values of motors unless all are finite."""
    finite = np.isfinite(values)
    if not finite.all():
        motor, column = np.argwhere(~finite)[0]
        raise WireError(
            f"{names[column]} of motor {motor} in a {layout.type_name} is {values[motor, column]}, not finite."
        )


def _fill_imu(image: Image, imu: Imu, layout: Layout) -> None:
    with np.errstate(over="ignore"):
        image["quaternion"] = imu.quat
        image["gyroscope"] = imu.gyro
        image["accelerometer"] = imu.acc
    _read_imu(image, layout)
    image["rpy"] = rpy(imu.quat)


def _read_imu(image: Image, layout: Layout) -> Imu:
    values = [image[name] for name in ("quaternion", "gyroscope", "accelerometer")]
    if not all(np.isfinite(value).all() for value in values):  # a cast of a signalling NaN would warn
        raise WireError(f"The IMU in a {layout.type_name} is not finite: {values}.")
    quat, gyro, acc = (value.astype(np.float64) for value in values)
    if abs(float(quat @ quat) - 1.0) > 2.0 * _UNIT:
        raise WireError(f"The quaternion of the IMU in a {layout.type_name} is no unit quaternion: {quat}.")
    return Imu(quat, gyro, acc)
