"""Between the bus of a process and the domain: one class out, one in, both made from the rows of the public table.

A new stream is a row, its converter, and the code that puts its values on the bus or takes them from there.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Mapping
from typing import Any

from golem.interfaces import public
from golem.interfaces.rows import TopicRow
from golem.middleware.bus import Bus, News
from golem.runtime.executor import Node, Phase, Placed
from golem.runtime.live.node_setup import log_line
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.types import TICK

QUIET = 5.0
"""Time between two complaints of one kind [s]."""


class RejectedMessages:
    """Messages of one kind that were refused, the last one for `why`; the first is said at once."""

    def __init__(self, what: str, tell: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        """Call a message `what`; `tell` a person, without being held up, on this process's own `clock` [s]."""
        self._what, self._tell, self._clock = what, tell, clock
        self.count, self.why = 0, ""
        self._said = -math.inf

    def add(self, error: Exception) -> None:
        """Count one more."""
        self.count, self.why = self.count + 1, str(error)
        now = self._clock()
        if now - self._said >= QUIET:
            self._said = now
            self._tell(f"{self.count} {self._what} refused so far, the last one because: {error}")


AT_ONCE = {"/lowstate": Phase.ESTIMATE, "/clock": Phase.ESTIMATE, "/safety/lowcmd_in": Phase.PROTECT}
"""When in a tick what somebody waits for is sent; all else at its end."""

Encoders = Mapping[str, Callable[[Any], Any]]
"""By topic: what makes a message where the row cannot; None is no message."""
Takers = Mapping[str, Callable[[Any], None]]
"""By topic: what takes its values where they do not simply go to the bus."""


class StreamOut(Node):
    """Sends the values of one stream of the bus, each once; of a thinned one the newest of each period."""

    def __init__(
        self, bus: Bus, endpoints: RoleEndpoints, row: TopicRow, encode: Callable[[Any], Any] | None = None
    ) -> None:
        """Send what is on `bus`, as `row` or `encode` says. Raises ValueError: the row has no stream, or no rate."""
        if row.key is None or (row.thinned and row.rate is None):
            raise ValueError(f"the table does not say what to send on {row.name}, or how often")
        self.period = 1.0 / row.rate if row.thinned and row.rate is not None else TICK
        self._endpoints, self._name, self._encode = endpoints, row.name, encode
        self._news = News(bus, row.key)

    def step(self, t: float) -> None:
        value = self._news.read()
        if value is not None:
            self._endpoints.send(self._name, value, self._encode)


class StreamIn:
    """Brings the values of one topic to the bus; `refused` are messages that are none."""

    def __init__(
        self,
        bus: Bus,
        endpoints: RoleEndpoints,
        row: TopicRow,
        now: Callable[[], float],
        tell: Callable[[str], None] = log_line,
        take: Callable[[Any], None] | None = None,
    ) -> None:
        """Subscribe; `now` is robot time [s], and `tell` says to a person what is refused.

        Raises ValueError: the row is of no stream, not for this role, or cannot be read.
        """
        key = row.key
        if key is None:
            raise ValueError(f"the table does not say where {row.name} goes")
        self.refused = RejectedMessages(f"messages on {row.name}", tell)
        endpoints.listen(row.name, take or (lambda value: bus.publish(key, value, now())), self.refused.add)


def outgoing(
    bus: Bus, endpoints: RoleEndpoints, encoders: Encoders | None = None, without: Collection[str] = ()
) -> list[Placed]:
    """Return what sends every stream that `endpoints` offer, but those of topics `without`, which somebody else sends.

    The `encoders` are for rows that have none. Raises ValueError: nobody says how to send one of them.
    """
    encoders = encoders or {}
    return [
        (AT_ONCE.get(name, Phase.SEND), StreamOut(bus, endpoints, row, encoders.get(name)))
        for name, row in endpoints.rows.items()
        if row.key is not None and name not in without
    ]


def incoming(
    bus: Bus,
    endpoints: RoleEndpoints,
    now: Callable[[], float],
    tell: Callable[[str], None] = log_line,
    takers: Takers | None = None,
    without: Collection[str] = (),
) -> dict[str, StreamIn]:
    """Return what reads every stream that the table gives the role of `endpoints`, by topic.

    Args:
        now: robot time [s].
        tell: says to a person what is refused.
        takers: for values that do not simply go to the bus.
        without: topics that somebody else reads.

    A row that does not say how is left to whoever reads it.
    """
    takers = takers or {}
    return {
        row.name: StreamIn(bus, endpoints, row, now, tell, takers.get(row.name))
        for row in public.TOPICS
        if endpoints.role in row.to and row.key and row.decode and row.name not in without
    }
