"""What the safety gate says, as a message and for a person."""

from __future__ import annotations

from golem.interfaces.payloads import GateState, GateStatus, Reason
from golem.interfaces.ros_convert import header
from golem.middleware.ros.msgs import golem_interfaces


def describe_status(status: GateStatus) -> str:
    """Return the state of the gate and why, for a person."""
    why = ": ".join(part for part in (status.reason or "", status.detail) if part)
    return f"{status.state} ({why})" if why else str(status.state)


def status_message(status: GateStatus) -> golem_interfaces.SafetyStatus:
    """Return what the gate lets everybody know."""
    return golem_interfaces.SafetyStatus(header(status.t), status.state, status.reason or "", status.detail)


def to_status(message: golem_interfaces.SafetyStatus, t: float) -> GateStatus:
    """Return what the gate said, as of time `t` [s]; a state or a reason nobody knows is a shut gate."""
    try:
        return GateStatus(
            t, GateState(message.state), Reason(message.reason) if message.reason else None, message.detail
        )
    except ValueError:
        return GateStatus(t, GateState.INIT, None, f"the gate says '{message.state}', '{message.reason}'")
