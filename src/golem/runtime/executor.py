"""One clock for everything: lock-step (as fast as the machine allows) or paced by the wall clock.

Both ways execute the same nodes in the same order on the same simulated time; pacing only waits.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Container, Iterable, Sequence
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
        period: time between two steps [s], at least one tick; infinite for a node that only waits for news. One that
            becomes infinite ends the node's turns by time.

    A node may also have `wakes`, topics: it then has its turn at every tick at which one of them has news, too. Every
    node has its turn at the first tick.
    """

    period: float

    def step(self, t: float) -> None:
        """Read the bus, run the module once at time `t` [s], publish what it returns."""


class Chain(Protocol):
    """Nodes that have their turn at every tick, and can have it in compiled code; see `runtime.chain`."""

    @property
    def members(self) -> Sequence[Node]:
        """The nodes, in the order of their turns."""
        ...

    @property
    def hears(self) -> Container[str]:
        """Names of topics on which nobody else needs a turn for news."""
        ...

    def run(self, t: float, first: int, last: int) -> None:
        """Let the members from `first` up to `last` have their turns of the tick at `t` [s]."""

    def run_ticks(self, tick: int, offset: float, ticks: int) -> int:
        """Let all members have their turns of up to so many ticks.

        Args:
            tick: number of the first one, whose time is `offset + tick * TICK`.
            offset: time of the tick number 0 [s].
            ticks: how many at most, one or more.

        Returns:
            How many ticks have passed, at least one; fewer where others may want a turn.
        """
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


_NEVER = 1 << 62


def when_stepped() -> float:
    """Return when somebody wants to be asked who only wants to be after a node had its turn; see `Executor.run`."""
    return math.inf


class _Entry:
    """When one node is due: its k-th step happens at the first tick at or after k periods, and when it is woken.

    Attributes:
        link: its place in the chain; -1 for a node that is none of its.
        woken: whether a topic that it waits for has news.
    """

    __slots__ = ("due", "k", "link", "node", "period", "step", "woken")

    def __init__(self, node: Node, link: int = -1) -> None:
        if node.period < TICK - 1e-9:
            rate, maximum = 1.0 / node.period, 1.0 / TICK
            raise ConfigError(
                f"{type(node).__name__} wants to run at {rate:g} Hz; the clock allows up to {maximum:g} Hz."
            )
        self.node, self.step = node, node.step
        self.period = node.period / TICK
        self.link = link
        self.k = 0
        self.due = 0
        self.woken = False

    def advance(self) -> None:
        self.k += 1
        self._set_due()

    def skip(self, tick: int) -> None:
        if self.due < tick:
            self.k = math.ceil(tick / self.period - 1e-6)
            self._set_due()

    def _set_due(self) -> None:
        ended = self.node.period == math.inf
        self.due = _NEVER if ended else math.ceil(self.k * self.period - 1e-6)


class Executor:
    """Drives nodes in the given order on one clock."""

    def __init__(self, bus: Bus, nodes: Sequence[Node], start: float = 0.0, chain: Chain | None = None) -> None:
        """Schedule `nodes`, which exchange messages over `bus`. Raises ConfigError: a node is faster than the clock.

        They are in the order of their turns; those of `chain` run as one. A tick is to be at `start` [s]: a clock from
        outside need not start at a multiple of one.
        """
        self._bus, self._chain = bus, chain
        links = {} if chain is None else {id(node): i for i, node in enumerate(chain.members)}
        self._schedule = [self._entry(node, links.get(id(node), -1)) for node in nodes]
        self._tick = 0
        # Whole microseconds, so that it is exactly zero for a clock that ticks as this one does.
        self._offset = round(start - TICK * round(start / TICK), 6)

    def _entry(self, node: Node, link: int = -1) -> _Entry:
        entry = _Entry(node, link)
        for topic in getattr(node, "wakes", ()):
            self._bus.wake(topic, entry)
        return entry

    def add(self, node: Node) -> None:
        """Let `node` have the last turn of its ticks from now on: for who looks on."""
        entry = self._entry(node)
        entry.skip(self._tick)
        self._schedule.append(entry)

    @property
    def t(self) -> float:
        """Present time [s]."""
        return self._offset + self._tick * TICK

    def step(self) -> None:
        """Advance by one tick: deliver what is due, then step every node whose period has come or that has news."""
        t, tick, chain = self.t, self._tick, self._chain
        self._bus.deliver(t)
        first = last = -1
        for entry in self._schedule:
            if entry.link >= 0:
                first, last = entry.link if first < 0 else first, entry.link + 1
                continue
            due = tick >= entry.due
            if not (due or entry.woken):
                continue
            if first >= 0 and chain is not None:
                chain.run(t, first, last)
                first = -1
            entry.woken = False
            entry.step(t)
            if due:
                entry.advance()
        if first >= 0 and chain is not None:
            chain.run(t, first, last)
        self._tick += 1

    def _quiet_ticks(self, until: float) -> int:
        """Return for how many ticks from the present one on nobody but the chain has a turn, none after `until` [s]."""
        t = self.t
        came = self._bus.deliver(t, () if self._chain is None else self._chain.hears)
        due = _NEVER
        for entry in self._schedule:
            if entry.link < 0:
                if entry.woken:
                    return 0
                if entry.due < due:
                    due = entry.due
        if came or due <= self._tick or until <= t:
            return min(1, due - self._tick)
        delivery = self._bus.next_delivery()
        ticks = min(due - self._tick, math.ceil((until - t) / TICK - 1e-6))
        if delivery < t + ticks * TICK:
            ticks = min(ticks, math.ceil((delivery - 5e-7 - t) / TICK))
        return max(ticks, 1)

    def advance(self, t: float, maximum: int) -> None:
        """Follow a clock from outside up to time `t` [s]; ticks further back than the last `maximum` are left out."""
        target = round((t - self._offset) / TICK)
        if target - self._tick >= maximum:
            self._tick = target - maximum + 1
            for entry in self._schedule:
                entry.skip(self._tick)
        while self._tick <= target:
            self.step()

    def run(
        self,
        until: float,
        stop: Callable[[], bool] = lambda: False,
        realtime: bool = False,
        due: Callable[[], float] | None = None,
    ) -> None:
        """Step until time `until` [s] or until `stop()` is true.

        Args:
            until: simulated time to stop at [s].
            stop: asked after every tick.
            realtime: wait after each tick so that simulated time never runs ahead of the wall clock; a machine
                that is too slow falls behind and does not try to catch up.
            due: returns the time [s] at which `stop` has to be asked again; before that, it may be left out after a
                tick in which no node but the chain's had a turn. None: it is asked after every tick.
        """
        end = round(until / TICK)
        origin = time.perf_counter() - self.t
        together = self._chain if due is not None and not realtime else None
        while self._tick < end and not stop():
            if together is not None and due is not None:
                ticks = self._quiet_ticks(min(due(), self._offset + end * TICK))
                if ticks > 0:
                    self._tick += together.run_ticks(self._tick, self._offset, ticks)
                    continue
            self.step()
            if realtime:
                lag = time.perf_counter() - origin - self.t
                if lag < 0.0:
                    time.sleep(-lag)
                else:
                    origin += lag
