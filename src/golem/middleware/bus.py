"""The in-process bus: typed streams whose newest delivered value anybody may read.

A published value is delivered `latency` seconds after its time stamp, on whatever clock the caller uses: a slow
module thereby pays for its slowness in lock-step simulation. The bus holds values only, never callbacks or
modules: nobody can reach another module (or the simulator) through it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, cast

from golem.errors import GolemError

T = TypeVar("T")


class WrongType(GolemError):
    """A stream was given something else than it carries."""


@dataclass(frozen=True, slots=True)
class Topic(Generic[T]):
    """The key of one stream.

    Attributes:
        name: of the stream; one name has one kind.
        kind: class of its values.
    """

    name: str
    kind: type[T]


class Bus:
    """Latest-value streams by topic."""

    def __init__(self) -> None:
        """Start with no streams."""
        self._now: dict[str, object] = {}
        self._count: dict[str, int] = {}
        self._pending: dict[str, deque[tuple[float, object]]] = {}

    def publish(self, topic: Topic[T], value: T, t: float, latency: float = 0.0) -> None:
        """Send `value` on `topic` at time `t`; readers see it from `t + latency` on [s].

        Values of one topic are delivered in the order they were published.

        Raises:
            WrongType: the value is not of the topic's kind.
        """
        if not isinstance(value, topic.kind):
            raise WrongType(
                f"Topic '{topic.name}' carries {topic.kind.__name__}, not {type(value).__name__}."
            )
        name = topic.name
        if latency <= 0.0 and not self._pending.get(name):
            self._now[name] = value
            self._count[name] = self._count.get(name, 0) + 1
        else:
            self._pending.setdefault(name, deque()).append((t + latency, value))

    def withdraw(self, topic: Topic[Any]) -> None:
        """Forget what was published on `topic` and has not been delivered yet."""
        self._pending.pop(topic.name, None)

    def deliver(self, t: float) -> None:
        """Make every value that is due at time `t` visible. The executor calls it once per tick."""
        for name, queue in self._pending.items():
            # Half a microsecond of slack: ticks are sums of binary fractions.
            while queue and queue[0][0] <= t + 5e-7:
                self._now[name] = queue.popleft()[1]
                self._count[name] = self._count.get(name, 0) + 1

    def clear(self) -> None:
        """Forget every value, delivered or not; counts go on, so that no reader takes what comes next for old."""
        self._now.clear()
        self._pending.clear()

    def latest(self, topic: Topic[T]) -> T | None:
        """Return the newest delivered value of `topic`, or None before the first."""
        return cast("T | None", self._now.get(topic.name))

    def count(self, topic: Topic[Any]) -> int:
        """Return how many values of `topic` were delivered so far: a reader sees by it that a value is new."""
        return self._count.get(topic.name, 0)

    def topics(self) -> dict[str, str]:
        """Return the name of each stream that has delivered something, with the type it carries."""
        return {name: type(value).__name__ for name, value in sorted(self._now.items())}


class News(Generic[T]):
    """Reads one topic so that no value is taken twice."""

    def __init__(self, bus: Bus, topic: Topic[T]) -> None:
        """Begin now: what was delivered before does not count."""
        self._bus, self._topic = bus, topic
        self._seen = bus.count(topic)

    def read(self) -> T | None:
        """Return the newest value if it is new since the last reading, else None."""
        count = self._bus.count(self._topic)
        if count == self._seen:
            return None
        self._seen = count
        return self._bus.latest(self._topic)
