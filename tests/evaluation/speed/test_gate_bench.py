from __future__ import annotations

import pytest

pytest.importorskip("rosbags")

from golem.evaluation.speed.bench import check_ticks, gate_ticks


def test_ticks_of_an_active_gate_are_timed() -> None:
    times = gate_ticks(40)
    assert len(times) == 40 and 0.0 < times.min() and times.max() < 1.0


def test_ticks_of_the_gate_alone_are_timed() -> None:
    times = check_ticks(40)
    assert len(times) == 40 and 0.0 < times.min() and times.max() < 1.0
