"""The goals of one action server: their states, which of them a request to cancel means, how long results are kept.

States and transitions are those of ros2/rcl, rcl_action/src/rcl_action/goal_state_machine.c; the selection of goals to
cancel is that of `rcl_action_process_cancel_request` in action_server.c; codes and their meaning are those of
ros2/rcl_interfaces, action_msgs/srv/CancelGoal.srv. A result is kept for a while after its goal has ended, as the
design (design.ros2.org, "Actions", result caching) and rcl since PR 1121 have it. No transport and no clock in here.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum, IntEnum
from itertools import islice
from typing import Any

import numpy as np

from golem.middleware.ros.future import RosError
from golem.middleware.ros.message import NANO
from golem.middleware.ros.msgs.action_msgs import CancelGoal_Response, GoalInfo
from golem.middleware.ros.msgs.builtin_interfaces import Time
from golem.middleware.ros.msgs.unique_identifier_msgs import UUID


class GoalStatus(IntEnum):
    """State of a goal; the numbers of action_msgs/msg/GoalStatus."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @property
    def active(self) -> bool:
        """Whether the goal is still pursued."""
        return self in (GoalStatus.ACCEPTED, GoalStatus.EXECUTING, GoalStatus.CANCELING)

    @property
    def terminal(self) -> bool:
        """Whether the goal has ended."""
        return self >= GoalStatus.SUCCEEDED


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a goal ended.

    Attributes:
        status: SUCCEEDED, CANCELED or ABORTED; UNKNOWN if the server does not know the goal (any more).
        result: the action's result message; of no meaning if the status is UNKNOWN.
    """

    status: GoalStatus
    result: Any


class GoalEvent(Enum):
    """What may happen to a goal."""

    EXECUTE = "execute"
    CANCEL_GOAL = "cancel_goal"
    SUCCEED = "succeed"
    ABORT = "abort"
    CANCELED = "canceled"


class CancelCode(IntEnum):
    """Answer to a request to cancel; the numbers of action_msgs/srv/CancelGoal."""

    NONE = 0
    """Accepted: the listed goals are canceling (there may have been none to cancel)."""
    REJECTED = 1
    """No goal changed its state: the server declined."""
    UNKNOWN_GOAL_ID = 2
    """No goal with that id."""
    GOAL_TERMINATED = 3
    """The goal with that id cannot be canceled: it has ended, or is canceling already."""


@dataclass(frozen=True, slots=True)
class Canceling:
    """Answer to a request to cancel.

    Attributes:
        code: whether the server agreed.
        goals: ids of the goals that are canceling now; whether they end so, their outcomes tell.
    """

    code: CancelCode
    goals: tuple[bytes, ...]


TRANSITIONS = {
    (GoalStatus.ACCEPTED, GoalEvent.EXECUTE): GoalStatus.EXECUTING,
    (GoalStatus.ACCEPTED, GoalEvent.CANCEL_GOAL): GoalStatus.CANCELING,
    (GoalStatus.EXECUTING, GoalEvent.CANCEL_GOAL): GoalStatus.CANCELING,
    (GoalStatus.EXECUTING, GoalEvent.SUCCEED): GoalStatus.SUCCEEDED,
    (GoalStatus.EXECUTING, GoalEvent.ABORT): GoalStatus.ABORTED,
    (GoalStatus.CANCELING, GoalEvent.SUCCEED): GoalStatus.SUCCEEDED,
    (GoalStatus.CANCELING, GoalEvent.ABORT): GoalStatus.ABORTED,
    (GoalStatus.CANCELING, GoalEvent.CANCELED): GoalStatus.CANCELED,
}
NO_ID = bytes(16)
"""The id that stands for no particular goal."""
MAX_ENDED = 1000
"""Ended goals that are remembered at most; beyond it the oldest is forgotten before its time."""
MAX_REPORTED = 100
"""Ended goals whose status is published, so that the message stays small whatever clients do."""


class GoalState:
    """One goal's state: its `id` of 16 bytes is chosen by the client; `stamp` is when it was accepted [ns]."""

    def __init__(self, id: bytes, stamp: int) -> None:
        """Accept the goal with this `id` at time `stamp` [ns]."""
        self.id, self.stamp = id, stamp
        self.status = GoalStatus.ACCEPTED

    @property
    def cancelable(self) -> bool:
        """Whether it may be asked to cancel."""
        return (self.status, GoalEvent.CANCEL_GOAL) in TRANSITIONS

    def update(self, event: GoalEvent) -> None:
        """Let `event` happen. Raises RosError: it cannot happen in the present state."""
        status = self.status
        if (status, event) not in TRANSITIONS:
            valid = ", ".join(e.value for s, e in TRANSITIONS if s is status) or "nothing"
            raise RosError(
                f"Goal {self.id.hex()} is {status.name.lower()}: '{event.value}' cannot happen to it; "
                f"what can: {valid}."
            )
        self.status = TRANSITIONS[status, event]


class GoalTable:
    """Every goal of a server that is active or whose result is still kept, oldest first."""

    def __init__(self, result_timeout: float) -> None:
        """Keep results for `result_timeout` [s] after the end of their goal."""
        self._keep = result_timeout * NANO
        self._goals: dict[bytes, GoalState] = {}
        self._ended: deque[tuple[int, GoalState]] = deque()

    def __len__(self) -> int:
        return len(self._goals)

    def __contains__(self, id: bytes) -> bool:
        return id in self._goals

    def reported(self) -> list[GoalState]:
        """Return the goals whose status is published: the newest `MAX_REPORTED` that ended, then all that have not."""
        newest = islice(reversed(self._ended), MAX_REPORTED)
        return [goal for _, goal in newest][::-1] + [g for g in self._goals.values() if g.status.active]

    def accept(self, id: bytes, now: int) -> GoalState:
        """Take a new goal in at time `now` [ns]; its id must not be in use."""
        goal = self._goals[id] = GoalState(id, now)
        return goal

    def to_cancel(self, id: bytes, stamp: int) -> tuple[CancelCode, list[GoalState]]:
        """Return which goals a request to cancel means.

        Args:
            id: of a goal, or `NO_ID`.
            stamp: [ns]; 0 for none.

        Returns:
            With an id alone, that goal; with a stamp, every cancelable goal accepted at or before it, and the one with
            that id; with neither, every cancelable goal. The code is the answer should the server agree.
        """
        if id != NO_ID and stamp == 0:
            goal = self._goals.get(id)
            if goal is None:
                return CancelCode.UNKNOWN_GOAL_ID, []
            return (CancelCode.NONE, [goal]) if goal.cancelable else (CancelCode.GOAL_TERMINATED, [])
        everything = id == NO_ID and stamp == 0
        meant = [g for g in self._goals.values() if everything or g.stamp <= stamp or g.id == id]
        return CancelCode.NONE, [g for g in meant if g.cancelable]

    def update(self, goal: GoalState, event: GoalEvent, now: int) -> None:
        """Let `event` happen to `goal` at time `now` [ns]. Raises RosError: it cannot happen in its present state."""
        goal.update(event)
        if goal.status.terminal:
            self._ended.append((now, goal))

    def expire(self, now: int) -> list[GoalState]:
        """Forget the goals whose results were kept long enough at time `now` [ns], and return them."""
        if self._ended and self._ended[-1][0] > now:
            # The clock jumped back (a restarted simulation): nothing is kept for longer than it would have been.
            self._ended = deque((min(ended, now), goal) for ended, goal in self._ended)
        expired: list[GoalState] = []
        while self._ended and (len(self._ended) > MAX_ENDED or now - self._ended[0][0] >= self._keep):
            goal = self._ended.popleft()[1]
            del self._goals[goal.id]
            expired.append(goal)
        return expired


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
