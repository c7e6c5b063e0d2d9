"""The executor: every node at its rate, in order, on one clock."""

from __future__ import annotations

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.errors import ConfigError
from golem.middleware.bus import Bus, Topic
from golem.runtime.executor import Executor
from golem.types import TICK


class Recorder:
    """Remembers when it was stepped."""

    def __init__(self, period: float, name: str = "", log: list[str] | None = None) -> None:
        self.period, self.name, self.log = period, name, log
        self.times: list[float] = []

    def step(self, t: float) -> None:
        self.times.append(t)
        if self.log is not None:
            self.log.append(self.name)


def test_nodes_run_in_the_order_given_and_the_first_tick_is_at_zero() -> None:
    log: list[str] = []
    nodes = [Recorder(TICK, "a", log), Recorder(3 * TICK, "b", log), Recorder(TICK, "c", log)]
    executor = Executor(Bus(), nodes)
    for _ in range(4):
        executor.step()
    assert "".join(log) == "abc" + "ac" + "ac" + "abc"
    assert nodes[0].times == [0.0, TICK, 2 * TICK, 3 * TICK]
    assert executor.t == pytest.approx(4 * TICK)


@given(st.floats(1.0, 500.0))
def test_a_rate_that_does_not_divide_the_clock_is_kept_on_average(rate: float) -> None:
    node = Recorder(1.0 / rate)
    executor = Executor(Bus(), [node])
    executor.run(2.0)
    # The k-th step is at the first tick at or after k periods: no drift, never early, never late by a tick.
    for k, t in enumerate(node.times):
        assert -1e-8 <= t - k / rate < TICK - 1e-9
    assert len(node.times) == pytest.approx(2.0 * rate, abs=1)


def test_a_camera_at_15_hz_alternates_between_33_and_34_ticks() -> None:
    node = Recorder(1.0 / 15.0)
    Executor(Bus(), [node]).run(1.0)
    ticks = [round(t / TICK) for t in node.times]
    assert ticks[:5] == [0, 34, 67, 100, 134]
    assert len(ticks) == 15


def test_a_node_faster_than_the_clock_is_refused_by_name() -> None:
    with pytest.raises(ConfigError, match="Recorder wants to run at 1000 Hz; the clock allows up to 500 Hz"):
        Executor(Bus(), [Recorder(0.001)])


def test_what_is_due_is_delivered_before_the_nodes_run() -> None:
    bus, x = Bus(), Topic("x", int)
    seen: list[tuple[float, int | None]] = []

    class Reader:
        period = TICK

        def step(self, t: float) -> None:
            seen.append((t, bus.latest(x)))

    bus.publish(x, 5, t=0.0, latency=2 * TICK)
    Executor(bus, [Reader()]).run(4 * TICK)
    assert [value for _, value in seen] == [None, None, 5, 5]


def test_run_ends_at_the_time_asked_for() -> None:
    node = Recorder(TICK)
    executor = Executor(Bus(), [node])
    executor.run(0.1)
    assert len(node.times) == 50
    executor.run(0.1)
    assert len(node.times) == 50
    executor.run(0.2)
    assert len(node.times) == 100


def test_run_stops_when_told_before_the_next_tick() -> None:
    node = Recorder(TICK)
    Executor(Bus(), [node]).run(1.0, stop=lambda: len(node.times) >= 3)
    assert len(node.times) == 3


class Clock:
    """A wall clock on which sleeping is exact and each step of a node takes `cost`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.cost, self.slept = 100.0, 0.0, 0.0
        monkeypatch.setattr(time, "perf_counter", lambda: self.now)
        monkeypatch.setattr(time, "sleep", self._sleep)

    def _sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now += seconds
        self.slept += seconds


class Costly(Recorder):
    """A node that takes time."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(TICK)
        self.clock = clock

    def step(self, t: float) -> None:
        super().step(t)
        self.clock.now += self.clock.cost


def test_real_time_waits_so_that_robot_time_never_runs_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(monkeypatch)
    clock.cost = 0.0005
    Executor(Bus(), [Costly(clock)]).run(1.0, realtime=True)
    assert clock.now - 100.0 == pytest.approx(1.0, abs=1e-9)
    assert clock.slept == pytest.approx(1.0 - 500 * 0.0005, abs=1e-9)


def test_a_machine_too_slow_falls_behind_and_does_not_catch_up(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(monkeypatch)
    executor = Executor(Bus(), [Costly(clock)])
    clock.cost = 0.004
    executor.run(0.1, realtime=True)
    assert clock.slept == 0.0
    behind = clock.now
    clock.cost = 0.0
    executor.run(0.2, realtime=True)
    # At the pace of the wall again from the first tick on: the backlog is forgotten.
    assert clock.now - behind == pytest.approx(0.1, abs=1e-9)


def test_lock_step_never_sleeps(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(monkeypatch)
    Executor(Bus(), [Costly(clock)]).run(1.0)
    assert clock.slept == 0.0


def test_an_outside_clock_is_followed_tick_by_tick_and_a_gap_is_left_out() -> None:
    fast, slow = Recorder(TICK), Recorder(0.010)
    executor = Executor(Bus(), [fast, slow])
    executor.advance(53.412, maximum=5)
    assert fast.times == pytest.approx([53.404, 53.406, 53.408, 53.410, 53.412])
    assert slow.times == pytest.approx([53.41])
    executor.advance(53.412, maximum=5)
    executor.advance(53.416, maximum=5)
    assert fast.times[5:] == pytest.approx([53.414, 53.416])
    executor.advance(54.0, maximum=1)
    assert fast.times[7:] == pytest.approx([54.0])
    assert slow.times[1:] == pytest.approx([54.0])
    assert executor.t == pytest.approx(54.002)
