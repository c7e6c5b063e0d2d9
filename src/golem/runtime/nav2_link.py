"""Nav2 behind the bus, for the navigator that leaves the way to it."""

from __future__ import annotations

from golem.interfaces import topics
from golem.interfaces.nav_payloads import Nav2Goal, Nav2Reply
from golem.middleware.bus import Bus, News
from golem.types import PlanarPose, Twist


class BusNav2:
    """See `golem.capabilities.navigation.nav2.Nav2Link`."""

    def __init__(self, bus: Bus) -> None:
        """Speak over `bus`."""
        self._bus, self._number = bus, 0
        self._twists = News(bus, topics.NAV2_TWIST)

    def send(self, pose: PlanarPose) -> None:
        """Propose a goal; see `Nav2Link`."""
        self._number += 1
        self._twists.read()
        self._bus.publish(topics.NAV2_GOAL, Nav2Goal(self._number, pose), 0.0)  # no latency: the time has no meaning

    def reply(self) -> Nav2Reply | None:
        """Return how the newest goal stands; see `Nav2Link`."""
        reply = self._bus.latest(topics.NAV2_REPLY)
        return None if reply is None or reply.number != self._number else reply

    def twist(self) -> Twist | None:
        """Return a new twist; see `Nav2Link`."""
        said = self._twists.read()
        return None if said is None else said.twist
