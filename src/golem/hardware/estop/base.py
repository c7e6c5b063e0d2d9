"""The contract of an emergency stop: frames that keep coming, each saying whether the button is pressed."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from golem.interfaces.payloads import EstopMessage


@runtime_checkable
class EmergencyStop(Protocol):
    """A source of emergency-stop frames. Its silence stops the robot just as its button does."""

    @property
    def fault(self) -> str:
        """Why no frame has come lately, for whoever has to mend it; empty while they come."""
        ...

    def step(self, t: float) -> EstopMessage | None:
        """Return the frame that arrived at `t` [s], or None when none did."""
        ...
