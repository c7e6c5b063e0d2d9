"""Sweeps as they are typed."""

from __future__ import annotations

import pytest

from golem.errors import ConfigError
from golem.evaluation.harness.arguments import read_sweep


def test_a_range_and_a_list_become_cases() -> None:
    assert read_sweep("") == ({},)
    assert [c["light"] for c in read_sweep("light=0.1..3")] == [0.1, 0.234, 0.5477, 1.282, 3.0]
    assert [c["pack_yaw"] for c in read_sweep("pack_yaw=-0.2..0.2:3")] == [-0.2, 0.0, 0.2]
    assert [c["finish"] for c in read_sweep("finish=zinc,brass")] == ["zinc", "brass"]
    assert [c["light"] for c in read_sweep("light=0.3,1")] == [0.3, 1.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("light", "must read NAME=FROM..TO"),
        ("lamp=1..2", "light"),
        ("light=1..2:1", "from 2 to 100"),
        ("light=1..2:two", "from 2 to 100"),
        ("light=0..2", "from 0.01"),
        ("light=1,1", "twice"),
        ("finish=gold", "brass"),
    ],
)
def test_what_is_no_sweep_is_refused(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        read_sweep(text)
