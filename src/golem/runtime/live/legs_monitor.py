"""Says what the legs do that whoever stands beside the robot has to know, and would else see on topics only."""

from __future__ import annotations

from collections.abc import Callable

from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.runtime.nodes import moving

BLIND = 3.0
"""Time from the gate's activation on after which an estimator that has found no floor is worth a word [s]: one that
loses it is stopped, one that never had it is not, since a robot that hangs has its feet in the air."""


class LegsMonitor:
    """Tells of the fallback that took the legs, and of legs without a base estimate."""

    period = 0.1

    def __init__(self, bus: Bus, tell: Callable[[str], None]) -> None:
        """Watch `bus`; `tell` says a line to a person."""
        self._bus, self._tell = bus, tell
        self._fault: str | None = None
        self._blind_since: float | None = None

    def step(self, t: float) -> None:
        """Look at the legs' newest report and the newest base estimate at time `t` [s]."""
        legs = self._bus.latest(topics.LEG_STATUS)
        if legs is not None and legs.fault is not None and legs.fault != self._fault:
            self._fault = legs.fault
            self._tell(
                f"{legs.fault}. '{legs.controller}' has the legs now, and stands until a new twist comes."
            )
        base = self._bus.latest(topics.BASE)
        if not moving(self._bus):
            self._blind_since = t
        elif base is not None and not base.stale:
            self._blind_since = None
        if self._blind_since is not None and t - self._blind_since > BLIND:
            self._blind_since = None
            self._tell(
                "The estimator has found no foot on the floor since the gate was activated: do not put the robot's "
                "weight on its feet."
            )
