"""unitree_hg: state and command of the humanoids' motors, and the IMU.

Members and types: unitree_sdk2_python, unitree_sdk2py/idl/unitree_hg/msg/dds_. Both motor messages have 35 slots. A
motor's `mode` byte stands 4 bytes before its `q`, except the first motor's: two bytes stand before it in the same word,
so that it is only 2 bytes before its `q`. `first_mode` is that byte; `motor["mode"][0]` is not a mode but a byte of the
member before.
"""

from __future__ import annotations

from struct import Struct

import numpy as np
from numpy.typing import NDArray

from golem.middleware.dds.base import ENCAPSULATION, Payload
from golem.middleware.wire.crc import Checksum
from golem.middleware.wire.struct_layout import Fields, StructLayout, structure
from golem.types import NUM_JOINTS

_HEADER = len(ENCAPSULATION)
MOTORS = 35
"""Motor slots of a message; the H1-2 uses the first 27."""
ENABLE = 1
"""`mode` of a motor that follows its command; 0 is a motor that is off."""
PR = 0
"""`mode_pr` of ankles commanded as pitch and roll; 1 is as the two motors (A, B) that move them together."""

IMU: Fields = {
    "quaternion": (0, ("<f4", 4)),  # wxyz
    "gyroscope": (16, ("<f4", 3)),
    "accelerometer": (28, ("<f4", 3)),
    "rpy": (40, ("<f4", 3)),
    "temperature": (52, "<i2"),
}
_MOTOR_STATE = structure(
    56,
    {
        "mode": (0, "u1"),
        "q": (4, "<f4"),
        "dq": (8, "<f4"),
        "ddq": (12, "<f4"),
        "tau_est": (16, "<f4"),
        "temperature": (20, ("<i2", 2)),
        "vol": (24, "<f4"),
        "sensor": (28, ("<u4", 2)),
        "motorstate": (36, "<u4"),
        "reserve": (40, ("<u4", 4)),
    },
)
_MOTOR_CMD = structure(
    28,
    {
        "mode": (0, "u1"),
        "q": (4, "<f4"),
        "dq": (8, "<f4"),
        "tau": (12, "<f4"),
        "kp": (16, "<f4"),
        "kd": (20, "<f4"),
        "reserve": (24, "<u4"),
    },
)

IMU_STATE = StructLayout("unitree_hg::msg::dds_::IMUState_", 54, IMU)
LOW_STATE = StructLayout(
    "unitree_hg::msg::dds_::LowState_",
    2088,
    {
        "version": (0, ("<u4", 2)),
        "mode_pr": (8, "u1"),
        "mode_machine": (9, "u1"),
        "tick": (12, "<u4"),
        "imu": (16, structure(54, IMU)),
        "first_mode": (70, "u1"),
        "motor": (68, (_MOTOR_STATE, MOTORS)),
        "wireless_remote": (2028, ("u1", 40)),
        "reserve": (2068, ("<u4", 4)),
        "crc": (2084, "<u4"),
    },
)
LOW_CMD = StructLayout(
    "unitree_hg::msg::dds_::LowCmd_",
    1000,
    {
        "mode_pr": (0, "u1"),
        "mode_machine": (1, "u1"),
        "first_mode": (2, "u1"),
        "motor": (0, (_MOTOR_CMD, MOTORS)),
        "reserve": (980, ("<u4", 4)),
        "crc": (996, "<u4"),
    },
)

STATE_CHECKSUM = Checksum(first_mode=70, stride=56, motors=MOTORS, halves=(8,))
COMMAND_CHECKSUM = Checksum(first_mode=2, stride=28, motors=MOTORS)

STATE_NUMBERS = Struct(
    f"<4s 8x BB2x I 13f hB x 4f36x {(NUM_JOINTS - 1) * 'B3x4f36x'} {(MOTORS - NUM_JOINTS) * 56 + 60}x"
)
"""What is used of a `LowState_`: encapsulation; mode_pr, mode_machine; tick; floats and temperature of the IMU; and of
each motor mode, q, dq, ddq, tau_est. To go through the image instead takes twice the time [measured]."""
STATE_HEAD = Struct("<12x Bx2x I 10f")
"""mode_pr, tick, and quaternion, rates and specific force of a `LowState_`."""
COMMAND_HEAD = Struct("<BB")
"""mode_pr and mode_machine of a `LowCmd_`, after its encapsulation."""
ANSWERS, ANSWERS_AT = Struct("<I"), _HEADER + 980
"""The first word of its `reserve`, and where it is in a payload."""


def state_motors(payload: Payload) -> NDArray[np.float32]:
    """Return q, dq, ddq, tau_est of a `LowState_` of the right length as a (4, 27) view."""
    return np.ndarray((4, NUM_JOINTS), np.dtype("<f4"), payload, _HEADER + 72, (4, 56))


def command_motors(payload: Payload) -> NDArray[np.float32]:
    """Return q, dq, tau, kp, kd of a `LowCmd_` of the right length as a (5, 27) view; that of a bytearray is writable.

    A view takes a third of the time of a `Struct` that packs each number [measured].
    """
    return np.ndarray((5, NUM_JOINTS), np.dtype("<f4"), payload, _HEADER + 4, (4, 28))


def command_modes(payload: Payload) -> bytes:
    """Return the mode bytes of the 27 motors of a `LowCmd_` of the right length."""
    return bytes(payload[_HEADER + 2 : _HEADER + 3]) + bytes(payload[_HEADER + 28 : _HEADER + 28 * NUM_JOINTS : 28])


def all_on() -> bytearray:
    """Return a `LowCmd_` whose 27 motors are on, and all else zero."""
    payload = LOW_CMD.blank()
    image = LOW_CMD.read(payload)
    image["motor"]["mode"][:NUM_JOINTS] = ENABLE
    image["mode_pr"], image["first_mode"] = PR, ENABLE
    return payload
