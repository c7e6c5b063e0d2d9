"""The in-process bus: named streams whose newest delivered value anybody may read.

A published value is delivered `latency` seconds after its time stamp, on whatever clock the caller uses: a slow
module thereby pays for its slowness in lock-step simulation. The bus holds values only, never callbacks or
modules: nobody can reach another module (or the simulator) through it.
"""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

from golem.errors import GolemError

T = TypeVar("T")


class WrongType(GolemError):
    """A stream carries something else than its reader expects."""


class Bus:
    """Latest-value streams by topic name."""

    def __init__(self) -> None:
        """Start with no streams."""
        self._now: dict[str, object] = {}
        self._count: dict[str, int] = {}
        self._pending: dict[str, deque[tuple[float, object]]] = {}

    def publish(self, topic: str, value: object, t: float, latency: float = 0.0) -> None:
        """Send `value` on `topic` at time `t`; readers see it from `t + latency` on [s].

        Values of one topic are delivered in the order they were published.
        """
        if latency <= 0.0 and not self._pending.get(topic):
            self._now[topic] = value
            self._count[topic] = self._count.get(topic, 0) + 1
        else:
            self._pending.setdefault(topic, deque()).append((t + latency, value))

    def withdraw(self, topic: str) -> None:
        """Forget what was published on `topic` and has not been delivered yet."""
        self._pending.pop(topic, None)

    def deliver(self, t: float) -> None:
        """Make every value that is due at time `t` visible. The executor calls it once per tick."""
        for topic, queue in self._pending.items():
            # Half a microsecond of slack: ticks are sums of binary fractions.
            while queue and queue[0][0] <= t + 5e-7:
                self._now[topic] = queue.popleft()[1]
                self._count[topic] = self._count.get(topic, 0) + 1

    def clear(self) -> None:
        """Forget every value, delivered or not; counts go on, so that no reader takes what comes next for old."""
        self._now.clear()
        self._pending.clear()

    def latest(self, topic: str, kind: type[T]) -> T | None:
        """Return the newest delivered value of `topic`, or None before the first.

        Raises:
            WrongType: the value is not a `kind`.
        """
        value = self._now.get(topic)
        if value is None or isinstance(value, kind):
            return value
        raise WrongType(f"Topic '{topic}' carries {type(value).__name__}, not {kind.__name__}.")

    def count(self, topic: str) -> int:
        """Return how many values of `topic` were delivered so far: a reader sees by it that a value is new."""
        return self._count.get(topic, 0)

    def topics(self) -> dict[str, str]:
        """Return the name of each stream that has delivered something, with the type it carries."""
        return {name: type(value).__name__ for name, value in sorted(self._now.items())}


class News(Generic[T]):
    """Reads one topic so that no value is taken twice."""

    def __init__(self, bus: Bus, topic: str, kind: type[T]) -> None:
        """Begin now: what was delivered before does not count."""
        self._bus, self._topic, self._kind = bus, topic, kind
        self._seen = bus.count(topic)

    def read(self) -> T | None:
        """Return the newest value if it is new since the last reading, else None."""
        count = self._bus.count(self._topic)
        if count == self._seen:
            return None
        self._seen = count
        return self._bus.latest(self._topic, self._kind)
