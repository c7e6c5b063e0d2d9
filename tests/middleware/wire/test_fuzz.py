"""A short run of `fuzz.py`, whose command line does a long one."""

from __future__ import annotations

import pytest
from tests.middleware.wire import fuzz

from golem.middleware.wire.struct_layout import WireError

COUNT = 400
PEAK = 256 * 1024
"""Memory that decoding one payload may take [B]; the payloads have up to some 10 kB."""
TARGETS = fuzz.targets()


@pytest.mark.parametrize("name", TARGETS)
def test_a_mutated_payload_is_decoded_or_refused(name: str) -> None:
    target = TARGETS[name]
    taken, refused = fuzz.attack(target, COUNT, seed=1)
    assert taken + refused == COUNT
    assert taken and refused, (taken, refused)
    assert fuzz.peak(target, 40) < PEAK


def test_another_error_would_be_noticed() -> None:
    def decode(payload: bytes) -> object:
        if len(payload) > 2092:
            raise IndexError("a bug")
        raise WireError("refused")

    target = fuzz.Target(decode, TARGETS["LowState_"].seeds)
    with pytest.raises(IndexError):
        fuzz.attack(target, COUNT)
