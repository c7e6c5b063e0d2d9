"""Action clients and servers over rclpy; see `rclpy_node`."""

from __future__ import annotations

import math
import uuid
from collections.abc import Callable
from typing import Any, TypeVar

from golem.middleware.ros import codec
from golem.middleware.ros.base import ActionHandler, Canceling, Client, ClientGoal, Outcome, ServerGoal
from golem.middleware.ros.future import Future, RosError
from golem.middleware.ros.goal_info import canceling, goal_info, goal_status
from golem.middleware.ros.goals import NO_ID, GoalEvent, GoalStatus, after
from golem.middleware.ros.message import NANO
from golem.middleware.ros.msgs.action_msgs import CancelGoal_Request
from golem.middleware.ros.rclpy_types import Closing, Counter, from_rclpy, rclpy_module, rclpy_type, to_rclpy
from golem.middleware.ros.typed import check

T = TypeVar("T")
LONGEST = 1e6
"""Longest time that a result is kept [s]; rclpy counts nanoseconds in 64 bits."""


class RclpyClientGoal:
    """A goal as its client sees it; see `base.ClientGoal`."""

    def __init__(self, client: RclpyActionClient, handle: Any) -> None:
        """Wrap rclpy's `handle`."""
        self._client, self._handle = client, handle

    @property
    def id(self) -> bytes:
        """16 bytes."""
        return bytes(self._handle.goal_id.uuid)

    @property
    def accepted(self) -> bool:
        """Whether the server took the goal on."""
        return self._handle.accepted

    @property
    def status(self) -> GoalStatus:
        """The newest the server said."""
        return goal_status(self._handle.status)

    def result(self) -> Future[Outcome]:
        """Ask for the outcome."""
        return self._client.adopt(self._handle.get_result_async(), self._client.outcome)

    def cancel(self) -> Future[Canceling]:
        """Ask the server to cancel the goal."""
        return self._client.cancel(self.id)


class RclpyActionClient(Closing):
    """Gives goals to one action; see `base.ActionClient`."""

    def __init__(self, ros: Any, name: str, type: str, cancel: Client, count: Counter) -> None:
        """Use the action with absolute `name`; `cancel` calls its service that cancels goals."""
        self.name, self._handled, self._cancel = name, count, cancel
        self._type, self._ros_type = codec.action(type), rclpy_type(type)
        self._client = rclpy_module("rclpy.action").ActionClient(ros, self._ros_type, name)
        self._pending: dict[Any, Future[Any]] = {}

    def ready(self) -> bool:
        """Return whether a server with all its services and topics is there."""
        return self._client.server_is_ready() and self._cancel.ready()

    def send_goal(
        self, goal: Any, feedback: Callable[[Any], None] | None = None, id: bytes | None = None
    ) -> Future[ClientGoal]:
        """Propose a goal; see `base.ActionClient.send_goal`."""
        check(f"Action '{self.name}'", goal, self._type.Goal)
        if not self._client.server_is_ready():
            failed: Future[ClientGoal] = Future()
            failed.fail(RosError(f"No server of '{self.name}' is there."))
            return failed

        def pass_on(message: Any) -> None:
            self._handled.up()
            if feedback is not None:
                feedback(from_rclpy(message.feedback, self._type.Feedback))

        known_by = rclpy_module("unique_identifier_msgs.msg").UUID(uuid=list(id or uuid.uuid4().bytes))
        asked = self._client.send_goal_async(to_rclpy(goal, self._ros_type.Goal), pass_on, known_by)
        return self.adopt(asked, self._accepted)

    def cancel(self, id: bytes = NO_ID, before: float = 0.0) -> Future[Canceling]:
        """Ask to cancel goals; see `base.ActionClient.cancel`."""
        return self._cancel.call(CancelGoal_Request(goal_info(id, int(before * NANO)))).map(canceling)

    def adopt(self, asked: Any, convert: Callable[[Any], T]) -> Future[T]:
        """Return a future of `convert` of what rclpy's future `asked` brings."""
        future: Future[T] = Future(lambda: self._forget(asked))
        self._pending[asked] = future

        def answered(asked: Any) -> None:
            self._handled.up()
            if self._pending.pop(asked, None) is not None:
                future.complete(convert(asked.result()))

        asked.add_done_callback(answered)
        return future

    def outcome(self, response: Any) -> Outcome:
        """Return the outcome that a response to a request for the result tells."""
        return Outcome(goal_status(response.status), from_rclpy(response.result, self._type.Result))

    def keep(self) -> None:
        """Give up on what will not be answered any more; called at every poll."""
        if self._pending and not self._client.server_is_ready():
            self._give_up(f"The server of '{self.name}' has gone.")

    def _leave(self) -> None:
        self._give_up(f"The client of '{self.name}' was closed.")
        self._client.destroy()

    def _accepted(self, handle: Any) -> ClientGoal:
        return RclpyClientGoal(self, handle)

    def _forget(self, asked: Any) -> None:
        if self._pending.pop(asked, None) is not None:
            asked.cancel()

    def _give_up(self, reason: str) -> None:
        for future in list(self._pending.values()):
            future.cancel(reason)


class RclpyServerGoal:
    """A goal as its server pursues it; see `base.ServerGoal`."""

    def __init__(self, server: RclpyActionServer, handle: Any, request: Any) -> None:
        """Wrap rclpy's `handle`."""
        self._server, self._handle, self._request = server, handle, request
        self._result = rclpy_module("rclpy.task").Future()
        self._promised = False

    @property
    def id(self) -> bytes:
        """16 bytes."""
        return bytes(self._handle.goal_id.uuid)

    @property
    def request(self) -> Any:
        """The action's goal message."""
        return self._request

    @property
    def status(self) -> GoalStatus:
        """Where it stands."""
        return goal_status(self._handle.status)

    def execute(self) -> None:
        """Say that work on it begins."""
        after(self.id, self.status, GoalEvent.EXECUTE)
        self._promise()

    def feedback(self, feedback: Any) -> None:
        """Send a feedback message."""
        if not self.status.active:
            raise RosError(
                f"Goal {self.id.hex()} is {self.status.name.lower()}: there is no feedback on it any more."
            )
        self._handle.publish_feedback(self._server.feedback_message(feedback))

    def succeed(self, result: Any) -> None:
        """End it: reached."""
        self._end(GoalEvent.SUCCEED, self._handle.succeed, result)

    def abort(self, result: Any) -> None:
        """End it: failed."""
        self._end(GoalEvent.ABORT, self._handle.abort, result)

    def canceled(self, result: Any) -> None:
        """End it: given up as was asked."""
        self._end(GoalEvent.CANCELED, self._handle.canceled, result)

    def _promise(self) -> None:
        """Have rclpy wait for the result, which makes a goal executing unless it is canceling."""
        self._promised = True
        self._handle.execute(self._awaited)

    async def _awaited(self, _: Any) -> Any:
        return await self._result

    def _end(self, event: GoalEvent, end: Callable[[], None], result: Any) -> None:
        after(self.id, self.status, event)
        message = self._server.result_message(result)
        if not self._promised:
            self._promise()
        end()
        self._result.set_result(message)
        self._server.forget(self.id)


class RclpyActionServer(Closing):
    """Offers one action; see `base.ActionServer`."""

    def __init__(
        self, ros: Any, name: str, type: str, handler: ActionHandler, result_timeout: float, count: Counter
    ) -> None:
        """Offer the action with absolute `name`."""
        self.name, self._handler, self._handled = name, handler, count
        self._type, self._ros_type = codec.action(type), rclpy_type(type)
        self._goals: dict[bytes, RclpyServerGoal] = {}
        self._rclpy = rclpy_module("rclpy.action")
        self._server = self._rclpy.ActionServer(
            ros,
            self._ros_type,
            name,
            self._execute,
            goal_callback=self._decide,
            handle_accepted_callback=self._accepted,
            cancel_callback=self._cancel,
            result_timeout=math.ceil(min(result_timeout, LONGEST)),
        )

    def goals(self) -> list[ServerGoal]:
        """Return the goals that have not ended, oldest first."""
        return list(self._goals.values())

    def _leave(self) -> None:
        self._goals.clear()
        self._server.destroy()

    def forget(self, id: bytes) -> None:
        """Count a goal as ended."""
        self._goals.pop(id, None)

    def result_message(self, result: Any) -> Any:
        """Return rclpy's message of a result."""
        check(f"Action '{self.name}'", result, self._type.Result)
        return to_rclpy(result, self._ros_type.Result)

    def feedback_message(self, feedback: Any) -> Any:
        """Return rclpy's message of feedback."""
        check(f"Action '{self.name}'", feedback, self._type.Feedback)
        return to_rclpy(feedback, self._ros_type.Feedback)

    def _decide(self, request: Any) -> Any:
        self._handled.up()
        accept = self._handler.decide(from_rclpy(request, self._type.Goal))
        return self._rclpy.GoalResponse.ACCEPT if accept else self._rclpy.GoalResponse.REJECT

    def _accepted(self, handle: Any) -> None:
        goal = RclpyServerGoal(self, handle, from_rclpy(handle.request, self._type.Goal))
        self._goals[goal.id] = goal
        self._handler.accepted(goal)

    def _cancel(self, handle: Any) -> Any:
        self._handled.up()
        goal = self._goals.get(bytes(handle.goal_id.uuid))
        agreed = goal is not None and self._handler.cancel(goal)
        return self._rclpy.CancelResponse.ACCEPT if agreed else self._rclpy.CancelResponse.REJECT

    def _execute(self, _: Any) -> Any:
        """What rclpy wants to be given; every goal brings its own (`RclpyServerGoal`)."""
        raise NotImplementedError
