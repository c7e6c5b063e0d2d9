from __future__ import annotations

import numpy as np
import pytest

from golem.dashboard.history import BALANCE, SIGNALS, SPAN, History, Snapshot, read_signals
from golem.middleware.bus import Bus


def moment(t: float) -> Snapshot:
    signals = np.zeros(len(SIGNALS))
    signals[SIGNALS.index(BALANCE)] = t / 1000.0
    return Snapshot(t, np.full((2, 3), t), np.zeros((2, 4)), signals)


@pytest.fixture
def history() -> History:
    history = History()
    for i in range(1000):
        history.add(moment(0.1 * i))
    return history


def test_the_last_minute_is_kept(history: History) -> None:
    times, values = history.trace(BALANCE)
    assert times[0] == pytest.approx(-SPAN, abs=0.11) and times[-1] == 0.0 and len(times) == pytest.approx(601, abs=1)
    np.testing.assert_allclose(values, (times + 99.9) / 1000.0, atol=1e-12)


@pytest.mark.parametrize(("age", "t"), [(0.0, 99.9), (10.04, 89.8), (59.0, 40.9), (1e3, 39.9)])
def test_a_moment_of_that_age_or_the_oldest_is_found(history: History, age: float, t: float) -> None:
    found = history.before(age)
    assert found is not None and found.t == pytest.approx(t, abs=0.101) and (found.positions == found.t).all()


def test_nothing_is_known_before_the_first() -> None:
    assert History().before(0.0) is None
    signals = read_signals(Bus(), 0.1)
    assert signals[SIGNALS.index(BALANCE)] == 0.1 and np.isnan(signals).sum() == len(SIGNALS) - 1
