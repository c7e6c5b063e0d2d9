from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest

from golem.middleware.interrupt import interrupted


@pytest.fixture(autouse=True)
def hangup() -> Iterator[None]:
    """SIGHUP as in a terminal, however these tests were started; as before at the end."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_sets_the_event_and_is_given_back(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with interrupted() as stop:
        assert not stop.is_set()
        signal.raise_signal(number)
        assert stop.wait(10.0)
    assert signal.getsignal(number) is before


@pytest.mark.parametrize("number", [signal.SIGTSTP, signal.SIGQUIT])
def test_who_must_not_be_frozen_or_killed_hears_those_keys_too(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with interrupted(also=[number]) as stop:
        signal.raise_signal(number)
        assert stop.wait(10.0)
    assert signal.getsignal(number) is before


def test_who_was_started_by_nohup_outlives_its_terminal() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with interrupted() as stop:
        signal.raise_signal(signal.SIGHUP)
        assert not stop.wait(0.05)
