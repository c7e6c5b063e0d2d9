"""The node of the lower body: connects a leg controller to the bus."""

from __future__ import annotations

from golem.capabilities.legs.base import STANDING, LegCommand, LowerBody
from golem.middleware import topics
from golem.middleware.bus import Bus
from golem.runtime.guard import Guard
from golem.runtime.nodes import MIN_RATE, moving
from golem.types import LEGS, BaseEstimate, LowState


class LowerBodyNode:
    """Runs the leg controller at its rate."""

    def __init__(self, bus: Bus, legs: LowerBody, guard: Guard) -> None:
        """Run `legs`."""
        self._bus, self._legs, self._guard = bus, legs, guard
        self._latency = guard.number("latency", legs.latency, least=0.0)
        self.period = 1.0 / guard.number("rate", legs.rate, least=MIN_RATE)

    def step(self, t: float) -> None:
        """Publish leg targets."""
        state = self._bus.latest(topics.LOW_STATE, LowState)
        base = self._bus.latest(topics.BASE, BaseEstimate)
        if state is None or base is None:
            return
        if not moving(self._bus):
            self._guard.call(self._legs.reset, state)
        command = self._guard.call(self._legs.step, state, base, STANDING, self.period)
        self._guard.kind("the leg command", command, LegCommand)
        for name in ("q", "kp", "kd"):
            self._guard.array(name, getattr(command, name), LEGS.stop - LEGS.start)
        if command.tau is not None:
            self._guard.array("tau", command.tau, LEGS.stop - LEGS.start)
        self._bus.publish(topics.LEG_COMMAND, command, t, self._latency)
