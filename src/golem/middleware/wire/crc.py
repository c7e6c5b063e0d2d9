"""The checksum of the vendor's motor messages.

It is a CRC-32 with the polynomial 0x04C11DB7, register preset to ones, neither reflected nor inverted at the end, over
the little-endian 32-bit words, most significant bit first, of the message as a C structure (unitree_sdk2_python,
unitree_sdk2py/utils/crc.py). zlib computes the reflected and inverted one: reversing the bits of every byte before and
of the result after turns one into the other.
"""

from __future__ import annotations

import zlib

import numpy as np

from golem.middleware.dds.base import ENCAPSULATION, Payload

_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_WORD = 4


def crc32(words: bytes) -> int:
    """Return the checksum of 32-bit words given as big-endian bytes."""
    crc = zlib.crc32(words.translate(_REVERSED)) ^ 0xFFFFFFFF
    return int.from_bytes(crc.to_bytes(4, "little").translate(_REVERSED), "big")


class Checksum:
    """The checksum of one message type, computed from its CDR image.

    The C structure differs from the CDR body in one place: there the first motor begins a word of its own, while in CDR
    its mode byte shares a word with what stands before it. Padding, which a sender may fill with anything, counts as
    zero.
    """

    def __init__(
        self, size: int, first_mode: int, stride: int, motors: int, halves: tuple[int, ...] = ()
    ) -> None:
        """Describe the type.

        Args:
            size: bytes of a payload, header included; the last word is the checksum itself.
            first_mode: offset of the first motor's mode byte in the body.
            stride: bytes from one motor to the next.
            motors: how many there are.
            halves: offsets in the body of words of which only the lower half is used.
        """
        self._split = first_mode // _WORD
        self._mask = np.full((size - len(ENCAPSULATION)) // _WORD, 0xFFFFFFFF, np.uint32)
        modes = self._split + stride // _WORD * np.arange(1, motors)
        self._mask[modes] = 0xFF
        self._mask[np.array(halves, int) // _WORD] = 0xFFFF

    def of(self, payload: Payload) -> int:
        """Return the checksum that `payload`, of the right length, should carry."""
        split = self._split
        body = np.frombuffer(payload, "<u4", offset=len(ENCAPSULATION)) & self._mask
        words = np.empty(len(body), ">u4")
        words[:split] = body[:split]
        words[split] = body[split] & 0xFFFF
        words[split + 1] = body[split] >> 16 & 0xFF
        words[split + 2 :] = body[split + 1 : -1]
        return crc32(words.tobytes())

    def seal(self, payload: bytearray) -> None:
        """Write the checksum of `payload` into it."""
        payload[-_WORD:] = self.of(payload).to_bytes(_WORD, "little")

    def holds(self, payload: Payload) -> bool:
        """Return whether `payload` carries the right checksum."""
        return int.from_bytes(payload[-_WORD:], "little") == self.of(payload)
