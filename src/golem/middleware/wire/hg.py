"""unitree_hg: state and command of the humanoids' motors, and the IMU.

Members and types: unitree_sdk2_python, unitree_sdk2py/idl/unitree_hg/msg/dds_. Both motor messages have 35 slots. A
motor's `mode` byte stands 4 bytes before its `q`, except the first motor's: two bytes stand before it in the same word,
so that it is only 2 bytes before its `q`. `first_mode` is that byte; `motor["mode"][0]` is not a mode but a byte of the
member before.

The checksum of the vendor's motor messages.

It is a CRC-32 with the polynomial 0x04C11DB7, register preset to ones, neither reflected nor inverted at the end, over
the little-endian 32-bit words, most significant bit first, of the message as a C structure (unitree_sdk2_python,
unitree_sdk2py/utils/crc.py). zlib computes the reflected and inverted one: reversing the bits of every byte before and
of the result after turns one into the other.
"""

from __future__ import annotations

import zlib
from array import array
from struct import Struct

import numpy as np
from numpy.typing import NDArray

from golem.middleware.dds.base import ENCAPSULATION, Payload
from golem.middleware.wire.struct_layout import Fields, StructLayout, structure
from golem.types import NUM_JOINTS

REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
"""Every byte with its bits reversed."""
_WORD = 4


class Checksum:
    """The checksum of one message type, computed from its CDR image.

    The C structure differs from the CDR body in one place: there the first motor begins a word of its own, while in CDR
    its mode byte shares a word with what stands before it. Padding, which a sender may fill with anything, counts as
    zero.
    """

    def __init__(self, first_mode: int, stride: int, motors: int, halves: tuple[int, ...] = ()) -> None:
        """Describe the type.

        Args:
            first_mode: offset of the first motor's mode byte in the body, the third of its word.
            stride: bytes from one motor to the next.
            motors: how many there are.
            halves: offsets in the body of words of which only the lower half is used.
        """
        self._split = first_mode - 2
        second, end = self._split + stride, self._split + stride * motors
        padding = [slice(second + i, end, stride) for i in (1, 2, 3)]
        self._padding = [(where, bytes(motors - 1)) for where in padding]
        self._padding += [(slice(offset + 2, offset + 4), bytes(2)) for offset in halves]

    def of(self, payload: Payload) -> int:
        """Return the checksum that `payload`, of the right length, should carry."""
        body = bytearray(bytes(payload[len(ENCAPSULATION) : -_WORD]).translate(REVERSED))
        for where, zeros in self._padding:
            body[where] = zeros
        split = self._split
        body[split : split + 4] = b"%b\0\0%b\0\0\0" % (body[split : split + 2], body[split + 2 : split + 3])
        words = array("I", bytes(body))
        words.byteswap()
        return crc32(words)

    def seal(self, payload: bytearray) -> None:
        """Write the checksum of `payload` into it."""
        payload[-_WORD:] = self.of(payload).to_bytes(_WORD, "little")

    def holds(self, payload: Payload) -> bool:
        """Return whether `payload` carries the right checksum."""
        return int.from_bytes(payload[-_WORD:], "little") == self.of(payload)


def crc32(reversed_words: bytes | array[int]) -> int:
    """Return the checksum of 32-bit words given as big-endian bytes with the bits of each reversed."""
    crc = zlib.crc32(reversed_words) ^ 0xFFFFFFFF
    return int.from_bytes(crc.to_bytes(4, "little").translate(REVERSED), "big")


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
