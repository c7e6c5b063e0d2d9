"""The frames of the emergency-stop board, out of a stream of bytes; firmware/estop/README.md describes them."""

from __future__ import annotations

import binascii
from dataclasses import dataclass

SIZE = 8
"""Bytes of a frame."""
SYNC = b"\xa5\x5a"
"""How a frame begins."""
RELEASED, PRESSED = 0x3C, 0xC3
"""The two states; all eight bits differ."""
SEQUENCES = 1 << 16
"""How many sequence numbers there are."""


@dataclass(frozen=True, slots=True)
class BoardFrame:
    """What one frame says.

    Attributes:
        sequence: counts up by one per frame, 0 to 65535, and wraps.
        pressed: whether the button is pressed, or its wire cut.
        echo: the newest byte that the board had received, 0 to 255.
    """

    sequence: int
    pressed: bool
    echo: int


def checksum(data: bytes) -> int:
    """Return the CRC-16/CCITT-FALSE of `data`: polynomial 0x1021, start 0xFFFF."""
    return binascii.crc_hqx(data, 0xFFFF)


class FrameParser:
    """Finds frames among bytes, and finds the next one after bytes that are none.

    Attributes:
        skipped: bytes that belonged to no sound frame.
    """

    def __init__(self) -> None:
        """Start at an unknown place of the stream."""
        self.skipped = 0
        self._rest = b""

    def feed(self, data: bytes) -> list[BoardFrame]:
        """Return the sound frames that `data` completes, in order; what may begin one is kept for the next call."""
        data = self._rest + data
        frames: list[BoardFrame] = []
        at = 0
        while len(data) - at >= SIZE:
            frame = _decode(data[at : at + SIZE])
            if frame is not None:
                frames.append(frame)
                at += SIZE
                continue
            self.skipped += 1
            at += 1
        self._rest = data[at:]
        return frames


def _decode(data: bytes) -> BoardFrame | None:
    body, state = data[:-2], data[4]
    if body[:2] != SYNC or state not in (RELEASED, PRESSED):
        return None
    if checksum(body) != int.from_bytes(data[-2:], "little"):
        return None
    return BoardFrame(int.from_bytes(body[2:4], "little"), state == PRESSED, body[5])
