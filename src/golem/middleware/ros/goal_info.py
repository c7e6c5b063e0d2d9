"""Goal ids, times, states and answers as the messages of actions carry them."""

from __future__ import annotations

import numpy as np

from golem.middleware.ros.goals import CancelCode, Canceling, GoalStatus
from golem.middleware.ros.message import NANO
from golem.middleware.ros.msgs.action_msgs import CancelGoal_Response, GoalInfo
from golem.middleware.ros.msgs.builtin_interfaces import Time
from golem.middleware.ros.msgs.unique_identifier_msgs import UUID

CANCEL_GOAL = "action_msgs/srv/CancelGoal"
STATUS_ARRAY = "action_msgs/msg/GoalStatusArray"


def to_uuid(id: bytes) -> UUID:
    """Return the message of a goal id (16 bytes)."""
    return UUID(np.frombuffer(id, np.uint8))


def from_uuid(message: UUID) -> bytes:
    """Return the goal id (16 bytes) of a message."""
    return message.uuid.tobytes()


def to_time(stamp: int) -> Time:
    """Return the message of a time [ns]."""
    return Time(*divmod(stamp, NANO))


def from_time(message: Time) -> int:
    """Return the time of a message [ns]."""
    return message.sec * NANO + message.nanosec


def goal_info(id: bytes, stamp: int) -> GoalInfo:
    """Return the message of a goal's id and time [ns]."""
    return GoalInfo(to_uuid(id), to_time(stamp))


def canceling(response: CancelGoal_Response) -> Canceling:
    """Return the answer that a response to a request to cancel tells."""
    try:
        code = CancelCode(response.return_code)
    except ValueError:  # a code of the future is no consent
        code = CancelCode.REJECTED
    return Canceling(code, tuple(from_uuid(info.goal_id) for info in response.goals_canceling))


def goal_status(number: int) -> GoalStatus:
    """Return the status with this number; UNKNOWN if there is none."""
    try:
        return GoalStatus(number)
    except ValueError:
        return GoalStatus.UNKNOWN
