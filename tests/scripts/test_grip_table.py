"""The table of slipping and crushing: what it must find with forces that are known to do either."""

from __future__ import annotations

from scripts.grip_table import THINGS, GripConfig, pressed, rows

from golem.hardware.hands.magpie import MagpieHand


def test_a_hand_presses_with_what_it_was_told() -> None:
    most, last = pressed(MagpieHand(), 4.0, 5000.0, 0.05)
    assert 3.9 < last <= most < 4.1


def test_too_little_slips_too_much_crushes_and_all_are_counted_once() -> None:
    found = {row[1]: row for row in rows(GripConfig(n=10, fixed=(0.3, 16.0)), "tomato", THINGS["tomato"])}
    assert found["magpie, 0.3 N"][5:8] == ("100.0", "0.0", "0.0")
    assert found["magpie, 16 N"][5:8] == ("0.0", "100.0", "0.0")
    for row in found.values():
        assert sum(map(float, row[5:8])) == 100.0
