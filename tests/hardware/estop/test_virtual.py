from __future__ import annotations

import pytest

from golem.hardware.estop.base import EmergencyStop
from golem.hardware.estop.estop_config import VirtualEstop
from golem.interfaces.payloads import EstopMessage


def frames(estop: VirtualEstop, start: float, ticks: int, dt: float = 0.002) -> list[EstopMessage]:
    return [frame for i in range(ticks) if (frame := estop.step(start + i * dt)) is not None]


def test_it_is_an_emergency_stop() -> None:
    assert isinstance(VirtualEstop(), EmergencyStop)


@pytest.mark.parametrize("dt", [0.002, 0.001, 0.005, 0.010])
def test_frames_come_at_100_hz_with_rising_sequence(dt: float) -> None:
    seen = frames(VirtualEstop(), 0.0, round(1.0 / dt), dt)
    assert len(seen) == 100
    assert [f.sequence for f in seen] == [i % 256 for i in range(1, 101)]


def test_the_sequence_wraps_without_repeating() -> None:
    seen = frames(VirtualEstop(), 0.0, 3000)
    assert all(a.sequence != b.sequence for a, b in zip(seen, seen[1:], strict=False))
    assert max(f.sequence for f in seen) == 255


def test_the_button_stays_in_until_released() -> None:
    estop = VirtualEstop()
    estop.press()
    assert all(f.pressed for f in frames(estop, 0.0, 50))
    estop.release()
    assert not any(f.pressed for f in frames(estop, 1.0, 50))
