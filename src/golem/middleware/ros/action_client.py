"""An action client over the transport contract; what it asks and keeps follows ros2/rclpy, rclpy/action/client.py."""

from __future__ import annotations

import uuid
import weakref
from collections.abc import Callable
from typing import Any

from golem.middleware.dds.base import DEFAULT, LATCHED
from golem.middleware.ros import codec, goals, names
from golem.middleware.ros.future import Future, RosError
from golem.middleware.ros.message import NANO
from golem.middleware.ros.msgs.action_msgs import CancelGoal_Request, GoalStatusArray
from golem.middleware.ros.node_endpoints import NodeEndpoints
from golem.middleware.ros.pubsub import Subscription
from golem.middleware.ros.service import Client


class ClientGoal:
    """A goal as its client sees it. Keep it as long as its feedback or status matters.

    Attributes:
        id: 16 bytes.
        accepted: whether the server took the goal on.
        status: the newest the server said; UNKNOWN before that.
        on_feedback: called with each feedback message.
    """

    def __init__(self, client: ActionClient, id: bytes, on_feedback: Callable[[Any], None] | None) -> None:
        """Belong to `client`, which is about to send it."""
        self._client, self.id = client, id
        self.accepted, self.status = False, goals.GoalStatus.UNKNOWN
        self.on_feedback = on_feedback

    def result(self) -> Future[goals.Outcome]:
        """Ask for the outcome; the future brings it once the goal has ended."""
        return self._client.get_result(self)

    def cancel(self) -> Future[goals.Canceling]:
        """Ask the server to cancel the goal."""
        return self._client.cancel(self.id)

    def answered(self, response: Any) -> ClientGoal:
        """Take in the server's decision and return itself."""
        self.accepted = bool(response.accepted)
        return self

    def learn(self, status: goals.GoalStatus) -> None:
        """Take in the status; what the status topic says late does not bring an ended goal back."""
        if not self.status.terminal:
            self.status = status


class ActionClient:
    """Gives goals to one action; feedback and statuses that cannot be read are passed over."""

    def __init__(self, endpoints: NodeEndpoints, name: str, type: str) -> None:
        self.name = name
        self._type, self._endpoints = codec.action(type), endpoints
        self._goals: weakref.WeakValueDictionary[bytes, ClientGoal] = weakref.WeakValueDictionary()
        parts = names.action(name)
        self._goal = Client(endpoints, parts.send_goal, f"{type}_SendGoal")
        self._cancel = Client(endpoints, parts.cancel_goal, goals.CANCEL_GOAL)
        self._result = Client(endpoints, parts.get_result, f"{type}_GetResult")
        feedback = f"{type}_FeedbackMessage"
        self._feedback = Subscription(endpoints, parts.feedback, feedback, self._on_feedback, DEFAULT)
        self._status = Subscription(endpoints, parts.status, goals.STATUS_ARRAY, self._on_status, LATCHED)

    def ready(self) -> bool:
        """Return whether a server with all its services and topics is there."""
        services = all(client.ready() for client in (self._goal, self._cancel, self._result))
        return services and self._feedback.matched() > 0 and self._status.matched() > 0

    def send_goal(
        self, goal: Any, feedback: Callable[[Any], None] | None = None, id: bytes | None = None
    ) -> Future[ClientGoal]:
        """Propose a goal; the future brings the server's decision.

        Args:
            feedback: called with each of the goal's feedback messages.
            id: 16 bytes to know it by; random if None.

        Raises:
            CodecError: it is not of the action's type.
            RosError: the id is not 16 bytes, or that of a goal in use.
        """
        codec.check(f"Action '{self.name}'", goal, self._type.Goal)
        id = uuid.uuid4().bytes if id is None else id
        if len(id) != 16 or id == goals.NO_ID or id in self._goals:
            raise RosError(f"A goal needs an id of its own, 16 bytes and not all zero; {id.hex()} cannot be it.")
        proposed = ClientGoal(self, id, feedback)
        answer = self._goal.call(self._type.SendGoal.Request(goals.to_uuid(id), goal))
        self._goals[id] = proposed
        return answer.map(proposed.answered)

    def cancel(self, id: bytes = goals.NO_ID, before: float = 0.0) -> Future[goals.Canceling]:
        """Ask to cancel goals, of any client: all; or that with `id`; or those accepted at or before a time, and `id`.

        Args:
            id: 16 bytes of a goal, or `NO_ID`.
            before: time on the server's clock [s]; 0 for none.
        """
        request = CancelGoal_Request(goals.goal_info(id, int(before * NANO)))
        return self._cancel.call(request).map(goals.canceling)

    def get_result(self, goal: ClientGoal) -> Future[goals.Outcome]:
        """Ask for the outcome of `goal`."""

        def outcome(response: Any) -> goals.Outcome:
            status = goals.goal_status(response.status)
            goal.learn(status)
            return goals.Outcome(status, response.result)

        return self._result.call(self._type.GetResult.Request(goals.to_uuid(goal.id))).map(outcome)

    def close(self) -> None:
        """Stop; what is unanswered fails. Calling it again does nothing."""
        for client in (self._goal, self._cancel, self._result):
            client.close()
        self._endpoints.close(self._feedback.inbox, self._status.inbox)

    def _on_feedback(self, message: Any) -> None:
        goal = self._goals.get(goals.from_uuid(message.goal_id))
        if goal is not None and goal.on_feedback is not None:
            goal.on_feedback(message.feedback)

    def _on_status(self, message: GoalStatusArray) -> None:
        for entry in message.status_list:
            goal = self._goals.get(goals.from_uuid(entry.goal_info.goal_id))
            if goal is not None:
                goal.learn(goals.goal_status(entry.status))
