"""The AX-12A servo: the part of its control table that a hand uses, in its own units.

Source: ROBOTIS e-manual, AX-12A.
"""

from __future__ import annotations

from dataclasses import dataclass

BAUD = 1_000_000
"""Factory setting [1/s]."""
TICKS = 1023
"""Largest position; also the largest load and torque limit."""
RANGE = 300.0
"""Angle that `TICKS` stands for [degrees]."""

SETTINGS = 24
"""Address of what `settings` writes: torque enable to torque limit."""
STATE = 36
"""Address of what `decode` reads: present position to present temperature."""
STATE_SIZE = 8
"""Bytes of it."""
MAX_READ = 14
"""Bytes from `STATE` to the end of the table."""


@dataclass(frozen=True, slots=True)
class Ax12State:
    """What a servo reports.

    Attributes:
        position: 0 to 1023, over `RANGE` degrees, counter-clockwise.
        speed: 0 to 1023; counter-clockwise positive.
        load: share of the largest torque that it applies, -1023 to 1023; counter-clockwise positive. 0 is no load:
            where nothing was read there is no `Ax12State`.
        voltage: [V].
        temperature: [degrees C].
    """

    position: int
    speed: int
    load: int
    voltage: float
    temperature: float


def decode(data: bytes) -> Ax12State:
    """Return what the `STATE_SIZE` bytes from `STATE` say; more bytes may follow.

    Raises:
        ValueError: they say something that no AX-12A reports.
    """
    if len(data) < STATE_SIZE:
        raise ValueError(f"{len(data)} bytes instead of {STATE_SIZE}")
    position, speed, load = (int.from_bytes(data[i : i + 2], "little") for i in (0, 2, 4))
    if position > TICKS or speed > 2 * TICKS + 1 or load > 2 * TICKS + 1:
        raise ValueError(f"position {position}, speed {speed}, load {load}")
    return Ax12State(position, _signed(speed), _signed(load), 0.1 * data[6], float(data[7]))


def settings(goal: int, speed: int, limit: int, margin: int, slope: int) -> bytes:
    """Return what is written from `SETTINGS`: all that a servo forgets when its power fails, so that none of it is old.

    Args:
        goal: position to go to, 0 to 1023.
        speed: at most, 1 to 1023; 1023 is 114 rpm. 0, which is no limit, is refused.
        limit: torque limit, 0 to 1023.
        margin: positions on either side of the goal without torque, 0 to 255.
        slope: how soft it is around the goal, 2 to 128.

    Raises:
        ValueError: a number is out of range.
    """
    if not (0 <= goal <= TICKS and 1 <= speed <= TICKS and 0 <= limit <= TICKS):
        raise ValueError(f"goal {goal}, speed {speed}, torque limit {limit}")
    words = b"".join(value.to_bytes(2, "little") for value in (goal, speed, limit))
    return bytes((1, 0, margin, margin, slope, slope)) + words


def _signed(value: int) -> int:
    """Return a number whose bit 10 says that it is clockwise."""
    return -(value & TICKS) if value & (TICKS + 1) else value & TICKS
