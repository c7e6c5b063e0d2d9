from __future__ import annotations

import signal

import pytest

from golem.middleware.interrupt import interrupted


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_sets_the_event_and_is_given_back(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with interrupted() as stop:
        assert not stop.is_set()
        signal.raise_signal(number)
        assert stop.wait(10.0)
    assert signal.getsignal(number) is before


def test_a_signal_that_is_ignored_stays_so() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with interrupted() as stop:
            signal.raise_signal(signal.SIGHUP)
            assert not stop.wait(0.05)
    finally:
        signal.signal(signal.SIGHUP, before)
