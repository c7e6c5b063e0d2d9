"""Packets of the Dynamixel protocol 1.0, as the AX-12A speaks it.

    instruction  FF FF  id  length  instruction  parameters...  checksum
    status       FF FF  id  length  error        parameters...  checksum

length = number of parameters + 2; checksum = inverted low byte of the sum of everything after FF FF.
Source: ROBOTIS e-manual, DYNAMIXEL Protocol 1.0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

READ, SYNC_WRITE = 0x02, 0x83
BROADCAST = 0xFE
"""Id of all servos; nobody answers."""
LAST_ID = 0xFD
MAX_PARAMETERS = 50
"""Parameters of a status at most: the whole table of an AX-12A."""
CHECKSUM_ERROR = 0x10
"""Error bit: the servo got an instruction with a wrong checksum."""
ERRORS = {
    0x01: "input voltage out of range",
    0x02: "goal beyond its angle limits",
    0x04: "overheated",
    0x08: "value out of range",
    CHECKSUM_ERROR: "instruction damaged",
    0x20: "overload",
    0x40: "instruction unknown",
}
"""What each bit of a status's error says."""


@dataclass(frozen=True, slots=True)
class StatusPacket:
    """What a servo answers: its `id` is 0 to 253, `error` has bits of `ERRORS`."""

    id: int
    error: int
    parameters: bytes

    @property
    def trouble(self) -> str:
        """What the error says; empty for none."""
        return ", ".join(text for bit, text in ERRORS.items() if self.error & bit)


def read_packet(servo: int, address: int, size: int) -> bytes:
    """Return the instruction to read `size` bytes from `address` of the table of `servo`."""
    return _packet(servo, READ, bytes((address, size)))


def sync_write_packet(address: int, values: Mapping[int, bytes]) -> bytes:
    """Return the instruction to write to several servos at once.

    Args:
        address: where in their tables.
        values: bytes by id, equally many for each.
    """
    (size,) = {len(data) for data in values.values()}
    rows = b"".join(bytes((servo,)) + data for servo, data in values.items())
    return _packet(BROADCAST, SYNC_WRITE, bytes((address, size)) + rows)


def checksum8(data: bytes) -> int:
    """Return the checksum of what stands between FF FF and it."""
    return ~sum(data) & 0xFF


class StatusParser:
    """Finds status packets among bytes, and finds the next one after bytes that are none.

    `skipped`: bytes that belonged to no sound packet.
    """

    def __init__(self) -> None:
        self.skipped = 0
        self._rest = b""

    def feed(self, data: bytes) -> list[StatusPacket]:
        """Return the sound packets that `data` completes, in order; what may begin one is kept for the next call."""
        data = self._rest + data
        packets: list[StatusPacket] = []
        while data:
            size = _size(data)
            if size is None:  # more of it has to come
                break
            if size and checksum8(data[2 : size - 1]) == data[size - 1]:
                packets.append(StatusPacket(data[2], data[4], data[5 : size - 1]))
                data = data[size:]
            else:
                self.skipped += 1
                data = data[1:]
        self._rest = data
        return packets

    def clear(self) -> None:
        """Forget what had begun: nothing more of it is expected."""
        self.skipped += len(self._rest)
        self._rest = b""


def _size(data: bytes) -> int | None:
    """Return the size of the packet that `data` begins with; 0 for none, None where more bytes must decide."""
    if not b"\xff\xff".startswith(data[:2]):
        return 0
    if len(data) < 4:
        return 0 if len(data) == 3 and data[2] > LAST_ID else None
    size = data[3] + 4
    if data[2] > LAST_ID or not 2 <= data[3] <= MAX_PARAMETERS + 2:
        return 0
    return size if len(data) >= size else None


def _packet(servo: int, instruction: int, parameters: bytes) -> bytes:
    body = bytes((servo, len(parameters) + 2, instruction)) + parameters
    return b"\xff\xff" + body + bytes((checksum8(body),))
