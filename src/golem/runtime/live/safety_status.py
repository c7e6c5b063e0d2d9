"""What the safety gate says, as a message and for a person."""

from __future__ import annotations

from collections.abc import Callable

from golem.interfaces.payloads import GateStatus
from golem.runtime.live.clock import Every
from golem.runtime.live.role_endpoints import RoleEndpoints

REPORT = 0.05
"""Time between two reports while nothing changes [s]."""


def describe_status(status: GateStatus) -> str:
    """Return the state of the gate and why, for a person."""
    why = ": ".join(part for part in (status.reason or "", status.detail) if part)
    return f"{status.state} ({why})" if why else str(status.state)


class StatusReports:
    """Sends the verdicts of the gate: at every change, and regularly."""

    def __init__(self, endpoints: RoleEndpoints) -> None:
        self._endpoints = endpoints
        self._said: tuple[object, ...] = ()
        self._due = Every(REPORT)

    def add(self, status: GateStatus) -> None:
        """Send a verdict if it says something else, or was not sent for long."""
        says = (status.state, status.reason)
        if says != self._said or self._due.due(status.t):
            self._said = says
            self._endpoints.send("/safety/status", status)


def report(before: GateStatus, now: GateStatus, tell: Callable[[str], None]) -> GateStatus:
    """Tell what the gate is now if it changed; return it."""
    if (now.state, now.reason) != (before.state, before.reason):
        tell(f"Safety gate: {describe_status(now)}")
    return now
