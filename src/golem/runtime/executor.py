"""One clock for everything: lock-step (as fast as the machine allows) or paced by the wall clock.

Both ways execute the same nodes in the same order on the same simulated time; pacing only waits.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from enum import IntEnum
from typing import Protocol

from golem.errors import ConfigError
from golem.middleware.bus import Bus
from golem.types import TICK

FOREVER = 1e9
"""A time that no robot sees [s]."""


class Node(Protocol):
    """What the executor drives: connects one module to the bus.

    Attributes:
        period: time between two steps [s], at least one tick.
    """

    period: float

    def step(self, t: float) -> None:
        """Read the bus, run the module once at time `t` [s], publish what it returns."""
        ...


class Phase(IntEnum):
    """When in a tick a node has its turn; the same in one process and in many."""

    RECEIVE = 0
    """What other processes sent comes in."""
    MEASURE = 1
    ESTIMATE = 2
    EXPOSE = 3
    PERCEIVE = 4
    DECIDE = 5
    SERVE = 6
    """The robot's own computer answers."""
    CONTROL = 7
    PROTECT = 8
    OPERATE = 9
    """What an operator does who watches the gate."""
    ACT = 10
    SEND = 11
    """What other processes want goes out."""


Placed = tuple[Phase, Node]
"""A node and its turn."""


def in_order(placed: Iterable[Placed]) -> list[Node]:
    """Return the nodes in the order of their phases; within a phase as given."""
    return [node for _, node in sorted(placed, key=lambda pair: pair[0])]


class _Entry:
    """When one node is due: its k-th step happens at the first tick at or after k periods."""

    __slots__ = ("due", "k", "period", "step")

    def __init__(self, node: Node) -> None:
        if node.period < TICK - 1e-9:
            rate, maximum = 1.0 / node.period, 1.0 / TICK
            raise ConfigError(
                f"{type(node).__name__} wants to run at {rate:g} Hz; the clock allows up to {maximum:g} Hz."
            )
        self.step = node.step
        self.period = node.period / TICK
        self.k = 0
        self.due = 0

    def advance(self) -> None:
        self.k += 1
        self.due = math.ceil(self.k * self.period - 1e-6)

    def skip(self, tick: int) -> None:
        """Leave out every step that was due before `tick`."""
        if self.due < tick:
            self.k = math.ceil(tick / self.period - 1e-6)
            self.due = math.ceil(self.k * self.period - 1e-6)


class Executor:
    """Drives nodes in the given order on one clock."""

    def __init__(self, bus: Bus, nodes: Sequence[Node], start: float = 0.0) -> None:
        """Schedule `nodes`, which exchange messages over `bus`.

        Args:
            bus: where they meet.
            nodes: in the order of their turns.
            start: a time that is to be a tick [s]; a clock from outside need not start at a multiple of one.

        Raises:
            ConfigError: a node is faster than the clock.
        """
        self._bus = bus
        self._schedule = [_Entry(node) for node in nodes]
        self._tick = 0
        # Whole microseconds, so that it is exactly zero for a clock that ticks as this one does.
        self._offset = round(start - TICK * round(start / TICK), 6)

    def add(self, node: Node) -> None:
        """Let `node` have the last turn of its ticks from now on: for who looks on."""
        entry = _Entry(node)
        entry.skip(self._tick)
        self._schedule.append(entry)

    @property
    def t(self) -> float:
        """Present time [s]."""
        return self._offset + self._tick * TICK

    def step(self) -> None:
        """Advance by one tick: deliver what is due, then step every node whose period has come."""
        t = self.t
        self._bus.deliver(t)
        for entry in self._schedule:
            if self._tick >= entry.due:
                entry.step(t)
                entry.advance()
        self._tick += 1

    def advance(self, t: float, maximum: int) -> None:
        """Follow a clock from outside up to time `t` [s]; ticks further back than the last `maximum` are left out."""
        target = round((t - self._offset) / TICK)
        if target - self._tick >= maximum:
            self._tick = target - maximum + 1
            for entry in self._schedule:
                entry.skip(self._tick)
        while self._tick <= target:
            self.step()

    def run(self, until: float, stop: Callable[[], bool] = lambda: False, realtime: bool = False) -> None:
        """Step until time `until` [s] or until `stop()` is true.

        Args:
            until: simulated time to stop at [s].
            stop: asked after every tick.
            realtime: wait after each tick so that simulated time never runs ahead of the wall clock; a machine
                that is too slow falls behind and does not try to catch up.
        """
        end = round(until / TICK)
        origin = time.perf_counter() - self.t
        while self._tick < end and not stop():
            self.step()
            if realtime:
                lag = time.perf_counter() - origin - self.t
                if lag < 0.0:
                    time.sleep(-lag)
                else:
                    origin += lag
