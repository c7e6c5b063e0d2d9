"""A module that takes far longer than it declares is named once, beside the results."""

from __future__ import annotations

import time
import warnings

import pytest

from golem.errors import SlowModule
from golem.runtime.contract_check import FIRST, MIN_SLOW, PATIENCE, STRIDE, ContractCheck


class Clock:
    """Stands in for `time`: `work` seconds of CPU and `sleep` seconds of waiting pass at every call of `module`."""

    def __init__(self, work: float, sleep: float = 0.0) -> None:
        self.work, self.sleep = work, sleep
        self.cpu = self.wall = 0.0
        self.looks = 0

    def thread_time(self) -> float:
        self.looks += 1
        return self.cpu

    def perf_counter(self) -> float:
        return self.wall

    def module(self) -> None:
        self.cpu += self.work
        self.wall += self.work + self.sleep


def said(monkeypatch: pytest.MonkeyPatch, clock: Clock, calls: int, allowed: float | None = 0.01) -> list[str]:
    """Return the warnings of so many calls."""
    monkeypatch.setattr("golem.runtime.contract_check.time", clock)
    contract = ContractCheck("upper_body", "mine.py:Arms")
    if allowed is not None:
        contract.times.allowed = allowed
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(calls):
            contract.call(clock.module)
    assert all(issubclass(w.category, SlowModule) for w in caught)
    return [str(w.message) for w in caught]


def test_fifty_milliseconds_a_tick_are_named_once(monkeypatch: pytest.MonkeyPatch) -> None:
    (text,) = said(monkeypatch, Clock(work=0.05), 200)
    assert text.startswith("upper_body: mine.py:Arms takes 50 ms a call; ") and "allow 10 ms" in text


def test_sleeping_counts_where_it_is_far_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    assert said(monkeypatch, Clock(work=0.001, sleep=0.2), 20)
    assert not said(monkeypatch, Clock(work=0.001, sleep=0.05), 200)  # a busy machine


@pytest.mark.parametrize("work", [0.001, 0.02])
def test_what_another_computer_explains_is_not_named(monkeypatch: pytest.MonkeyPatch, work: float) -> None:
    assert not said(monkeypatch, Clock(work), 200)


def test_a_slow_start_is_not_named(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(work=0.05)
    contract = ContractCheck("upper_body", "mine.py:Arms")
    contract.times.allowed = 0.01
    monkeypatch.setattr("golem.runtime.contract_check.time", clock)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for k in range(500):
            clock.work = 0.05 if k < MIN_SLOW - 1 else 0.001
            contract.call(clock.module)


def test_few_calls_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(work=0.001)
    said(monkeypatch, clock, FIRST + 10 * STRIDE)
    assert clock.looks == 2 * (FIRST + 10)
    clock.looks = 0
    said(monkeypatch, clock, 100, allowed=None)
    assert clock.looks == 0


def test_the_real_clocks_are_read() -> None:
    contract = ContractCheck("upper_body", "mine.py:Arms")
    contract.times.allowed = 1e-4
    with pytest.warns(SlowModule):
        for _ in range(MIN_SLOW):
            contract.call(time.sleep, 1.1 * PATIENCE)
