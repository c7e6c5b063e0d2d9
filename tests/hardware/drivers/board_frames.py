"""Frames as the firmware makes them, written down from its description a second time."""

from __future__ import annotations

from golem.hardware.estop.serial_board import BoardFrame


def crc16(data: bytes) -> int:
    """Return the CRC-16/CCITT-FALSE of `data`, bit by bit."""
    crc = 0xFFFF
    for byte in data:
        for bit in range(7, -1, -1):
            out = (crc >> 15) ^ (byte >> bit & 1)
            crc = (crc << 1 & 0xFFFF) ^ (0x1021 if out else 0)
    return crc


def frame_bytes(frame: BoardFrame) -> bytes:
    """Return the eight bytes of a frame."""
    body = b"\xa5\x5a" + frame.sequence.to_bytes(2, "little") + bytes((0xC3 if frame.pressed else 0x3C, frame.echo))
    return body + crc16(body).to_bytes(2, "little")
