"""The checksum of the vendor's motor messages.

It is a CRC-32 with the polynomial 0x04C11DB7, register preset to ones, neither reflected nor inverted at the end, over
the little-endian 32-bit words, most significant bit first, of the message as a C structure (unitree_sdk2_python,
unitree_sdk2py/utils/crc.py). zlib computes the reflected and inverted one: reversing the bits of every byte before and
of the result after turns one into the other.
"""

from __future__ import annotations

import zlib
from array import array

from golem.middleware.dds.base import ENCAPSULATION, Payload

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
