"""The in-process bus: typed streams whose newest delivered value anybody may read.

A published value is delivered `latency` seconds after its time stamp, on whatever clock the caller uses: a slow
module thereby pays for its slowness in lock-step simulation. The bus holds values only, never callbacks or
modules: nobody can reach another module (or the simulator) through it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from golem.errors import GolemError

T = TypeVar("T")


class WrongType(GolemError):
    """A stream was given something else than it carries."""


@dataclass(frozen=True, slots=True)
class Topic(Generic[T]):
    """The key of one stream, whose values are of the class `kind`; one name has one kind."""

    name: str
    kind: type[T]


class Deferred(Generic[T]):
    """A value that is made when somebody reads it, once; whoever publishes it does so again when it has changed."""

    __slots__ = ("made", "make", "name")

    def __init__(self, topic: Topic[T], make: Callable[[], T]) -> None:
        """Call `make` for the value, which is published on `topic`."""
        self.name, self.make = topic.name, make
        self.made: T | None = None

    def value(self) -> T:
        """Return the value."""
        if self.made is None:
            self.made = self.make()
        return self.made


class Waker(Protocol):
    """Who is to be told that a topic has news: `woken` is set to true whenever it has."""

    woken: bool


class Bus:
    """Latest-value streams by topic."""

    def __init__(self) -> None:
        self._now: dict[str, Any] = {}
        self._count: dict[str, int] = {}
        self._pending: dict[str, deque[tuple[float, object]]] = {}
        self._wakers: dict[str, list[Waker]] = {}

    def publish(self, topic: Topic[T], value: T, t: float, latency: float = 0.0) -> None:
        """Send `value` on `topic` at time `t`; readers see it from `t + latency` on [s].

        Values of one topic are delivered in the order they were published. Raises WrongType: the value is not of the
        topic's kind.
        """
        # Without a call of `isinstance` or `get`: nothing runs as often as this.
        if type(value) is not topic.kind and not isinstance(value, topic.kind):
            raise WrongType(f"Topic '{topic.name}' carries {topic.kind.__name__}, not {type(value).__name__}.")
        name = topic.name
        if latency <= 0.0 and (name not in self._pending or not self._pending[name]):
            self._show(name, value)
        else:
            self._pending.setdefault(name, deque()).append((t + latency, value))

    def defer(self, values: Iterable[Deferred[Any]], count: int = 1) -> None:
        """Publish on each topic `count` values, of which only the newest can still be made, when somebody reads it."""
        now, counts, wakers = self._now, self._count, self._wakers
        for value in values:
            name, value.made = value.name, None
            now[name] = value
            counts[name] = counts.get(name, 0) + count
            if name in wakers:
                self._wake(name)

    def _show(self, name: str, value: object) -> None:
        self._now[name] = value
        self._count[name] = self._count[name] + 1 if name in self._count else 1
        if name in self._wakers:
            self._wake(name)

    def _wake(self, name: str) -> None:
        for waker in self._wakers[name]:
            waker.woken = True

    def wake(self, topic: Topic[Any], waker: Waker) -> None:
        """Tell `waker` of all news of `topic` from now on."""
        self._wakers.setdefault(topic.name, []).append(waker)

    def next_delivery(self) -> float:
        """Return when the next value is due that is on its way [s]; infinity where none is."""
        return min((queue[0][0] for queue in self._pending.values() if queue), default=math.inf)

    def withdraw(self, topic: Topic[Any]) -> None:
        """Forget what was published on `topic` and has not been delivered yet."""
        self._pending.pop(topic.name, None)

    def deliver(self, t: float, besides: Container[str] = ()) -> bool:
        """Make every value due at `t` visible, once per tick; return whether one is on a topic not in `besides`."""
        some = False
        for name, queue in self._pending.items():
            # Half a microsecond of slack: ticks are sums of binary fractions.
            while queue and queue[0][0] <= t + 5e-7:
                self._show(name, queue.popleft()[1])
                some = some or name not in besides
        return some

    def clear(self) -> None:
        """Forget every value, delivered or not; counts go on, so that no reader takes what comes next for old."""
        self._now.clear()
        self._pending.clear()

    def latest(self, topic: Topic[T]) -> T | None:
        """Return the newest delivered value of `topic`, or None before the first."""
        value = self._now.get(topic.name)
        return value.value() if type(value) is Deferred else value

    def count(self, topic: Topic[Any]) -> int:
        """Return how many values of `topic` were delivered so far: a reader sees by it that a value is new."""
        return self._count.get(topic.name, 0)

    def topics(self) -> dict[str, str]:
        """Return the name of each stream that has delivered something, with the type it carries."""
        known = {n: v.value() if isinstance(v, Deferred) else v for n, v in sorted(self._now.items())}
        return {name: type(value).__name__ for name, value in known.items()}

    def newest(self, names: Iterable[str]) -> list[object]:
        """Return what `latest` reads on each topic, or its `Deferred` where it is one that nobody needs to make."""
        now = self._now
        return [now.get(name) for name in names]


class News(Generic[T]):
    """Reads one topic so that no value is taken twice."""

    def __init__(self, bus: Bus, topic: Topic[T]) -> None:
        self._bus, self._topic = bus, topic
        self._seen = bus.count(topic)

    @property
    def waiting(self) -> bool:
        """Whether there is a value that was not read."""
        return self._bus.count(self._topic) != self._seen

    def read(self) -> T | None:
        """Return the newest value if it is new since the last reading, else None."""
        count = self._bus.count(self._topic)
        if count == self._seen:
            return None
        self._seen = count
        return self._bus.latest(self._topic)
