"""What the safety gate and the emergency stop say, as ROS messages and back."""

from __future__ import annotations

from golem.interfaces.payloads import EstopMessage, GateState, GateStatus, Reason
from golem.interfaces.ros_convert import header, seconds
from golem.middleware.ros.msgs import golem_interfaces


def gate_status(status: GateStatus) -> golem_interfaces.SafetyStatus:
    """Return what the gate lets everybody know."""
    return golem_interfaces.SafetyStatus(header(status.t), status.state, status.reason or "", status.detail)


def to_gate_status(message: golem_interfaces.SafetyStatus) -> GateStatus:
    """Return what the gate said, at its own time; a state or a reason nobody knows is a shut gate."""
    t = seconds(message.header.stamp)
    try:
        reason = Reason(message.reason) if message.reason else None
        return GateStatus(t, GateState(message.state), reason, message.detail)
    except ValueError:
        return GateStatus(t, GateState.INIT, None, f"the gate says '{message.state}', '{message.reason}'")


def estop_frame(frame: EstopMessage) -> golem_interfaces.EstopFrame:
    """Return a frame of the emergency stop."""
    return golem_interfaces.EstopFrame(header(frame.t), frame.sequence, frame.pressed)
