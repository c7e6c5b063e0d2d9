"""An action server over the transport contract: three services and two topics around a table of goals.

What a server answers follows ros2/rclpy, rclpy/action/server.py, with two additions of ros2/rclcpp,
rclcpp_action/src/server.cpp: the status is published when a goal is accepted, too, and a request to cancel of which
nothing was granted is answered by ERROR_REJECTED. The status is published once a poll, however often it changed.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from golem.middleware.dds.base import DEFAULT, LATCHED
from golem.middleware.ros import codec, names
from golem.middleware.ros import goals as states
from golem.middleware.ros.future import RosError
from golem.middleware.ros.message import NANO
from golem.middleware.ros.msgs.action_msgs import CancelGoal_Request, CancelGoal_Response, GoalStatusArray
from golem.middleware.ros.msgs.action_msgs import GoalStatus as StatusMessage
from golem.middleware.ros.node_endpoints import NodeEndpoints
from golem.middleware.ros.service import Origin, Responder

RESULT_TIMEOUT = 10.0
"""How long an action's result is kept after its goal has ended [s]; rcl_action's default (action_server.c)."""
FEW = 10
"""Goals whose status is published at every change."""
SPACING = 0.001
"""Beyond them, time from one status to the next for each goal that it lists [s].

A client that floods us with goals then costs a small share of the time: the process may balance a robot."""
MAX_WAITING = 100
"""Requests for the result of one goal that are remembered; beyond it the oldest stays unanswered."""


class ServerGoal:
    """A goal as its server pursues it: active until it ends as succeeded, aborted or canceled.

    Attributes:
        id: 16 bytes.
        request: the action's goal message.
        client: 12 bytes, the same for all that one process of the sender's asks for; empty where nobody knows.
    """

    def __init__(self, server: ActionServer, state: states.GoalState, request: Any, client: bytes) -> None:
        """Belong to `server`, which has accepted it from `client`."""
        self._server, self._state = server, state
        self.id, self.request, self.client = state.id, request, client

    def attended(self) -> bool:
        """Return whether whoever sent it is still there."""
        return self._server.serves(self.client)

    @property
    def status(self) -> states.GoalStatus:
        """Where it stands; CANCELING once a request to cancel was accepted."""
        return self._state.status

    def execute(self) -> None:
        """Say that work begins; without it no success, no abort. Raises RosError: it does not wait to be executed."""
        self._server.update(self._state, states.GoalEvent.EXECUTE)

    def feedback(self, feedback: Any) -> None:
        """Send a feedback message. Raises RosError: the goal has ended."""
        self._server.send_feedback(self._state, feedback)

    def succeed(self, result: Any) -> None:
        """End it: reached. Raises RosError: it is neither executing nor canceling."""
        self._server.end(self._state, states.GoalEvent.SUCCEED, result)

    def abort(self, result: Any) -> None:
        """End it: failed. Raises RosError: it is neither executing nor canceling."""
        self._server.end(self._state, states.GoalEvent.ABORT, result)

    def canceled(self, result: Any) -> None:
        """End it: given up as was asked. Raises RosError: it is not canceling."""
        self._server.end(self._state, states.GoalEvent.CANCELED, result)


class ActionHandler(Protocol):
    """Decides about the goals of an action; pursuing them is the business of whoever keeps the `ServerGoal`s."""

    def decide(self, request: Any) -> bool:
        """Return whether to take on a goal, given its goal message."""
        ...

    def accepted(self, goal: ServerGoal) -> None:
        """Take charge of a goal; its client knows by now that it was accepted."""

    def cancel(self, goal: ServerGoal) -> bool:
        """Return whether to agree that `goal` be canceled; if so it is canceling when this has returned."""
        ...


class ActionServer:
    """Offers one action."""

    def __init__(
        self,
        endpoints: NodeEndpoints,
        name: str,
        type: str,
        handler: ActionHandler,
        now: Callable[[], float],
        result_timeout: float = RESULT_TIMEOUT,
    ) -> None:
        """Offer the action with absolute `name`; `now` is the node's clock [s]."""
        self.name = name
        self._handler, self._now, self._endpoints = handler, now, endpoints
        self._type = codec.action(type)
        self._table = states.GoalTable(result_timeout)
        self._active: dict[bytes, ServerGoal] = {}
        self._results: dict[bytes, bytes] = {}
        self._waiting: dict[bytes, deque[Origin]] = {}
        self._news, self._next_status = False, 0.0
        parts = names.action(name)
        self._feedback = endpoints.writer(names.topic(parts.feedback), f"{type}_FeedbackMessage", DEFAULT)
        self._status = endpoints.writer(names.topic(parts.status), states.STATUS_ARRAY, LATCHED)
        self._cancel = Responder(endpoints, parts.cancel_goal, states.CANCEL_GOAL, self._on_cancel)
        self._result = Responder(endpoints, parts.get_result, f"{type}_GetResult", self._on_result)
        self._goal = Responder(endpoints, parts.send_goal, f"{type}_SendGoal", self._on_goal)
        endpoints.attend(self)

    def goals(self) -> list[ServerGoal]:
        """Return the goals that have not ended, oldest first."""
        return list(self._active.values())

    def serves(self, client: bytes) -> bool:
        """Return whether the process `client` (12 bytes) may still send goals."""
        return self._goal.knows(client)

    def keep(self) -> None:
        """Forget what expired, publish the status if it changed; called at every poll."""
        for goal in self._table.expire(self._stamp()):
            del self._results[goal.id]
            self._news = True
        if self._news and (len(self._table) <= FEW or time.monotonic() >= self._next_status):
            self._news = False
            goals = [StatusMessage(states.goal_info(g.id, g.stamp), int(g.status)) for g in self._table.reported()]
            self._status.write(codec.serialize(GoalStatusArray(goals)))
            self._next_status = time.monotonic() + SPACING * len(goals)

    def close(self) -> None:
        """Stop; goals that have not ended never will. Calling it again does nothing."""
        self._endpoints.dismiss(self)
        for service in (self._goal, self._cancel, self._result):
            service.close()
        self._endpoints.close(self._feedback, self._status)

    def update(self, goal: states.GoalState, event: states.GoalEvent) -> None:
        """Let `event` happen to `goal`. Raises RosError: it cannot happen in the goal's present state."""
        self._table.update(goal, event, self._stamp())
        self._news = True

    def end(self, goal: states.GoalState, event: states.GoalEvent, result: Any) -> None:
        """End `goal` by `event` and send its result to those who asked for it.

        Raises:
            RosError: it cannot end so in its present state.
            CodecError: the result is not of the action's type.
        """
        # First, so that a result that cannot be sent does not end the goal.
        codec.serialize_as(f"Action '{self.name}'", result, self._type.Result)
        self.update(goal, event)
        response = codec.serialize(self._type.GetResult.Response(int(goal.status), result))
        self._results[goal.id] = response
        del self._active[goal.id]
        for origin in self._waiting.pop(goal.id, ()):
            self._result.reply(origin, response)

    def send_feedback(self, goal: states.GoalState, feedback: Any) -> None:
        """Publish feedback on `goal`. Raises RosError: the goal has ended; CodecError: it is of another type."""
        codec.check(f"Action '{self.name}'", feedback, self._type.Feedback)
        if not goal.status.active:
            raise RosError(f"Goal {goal.id.hex()} is {goal.status.name.lower()}: there is no feedback on it any more.")
        self._feedback.write(codec.serialize(self._type.FeedbackMessage(states.to_uuid(goal.id), feedback)))

    def _stamp(self) -> int:
        return int(self._now() * NANO)

    def _on_goal(self, origin: Origin, request: Any) -> None:
        id, stamp = states.from_uuid(request.goal_id), self._stamp()
        # The id of no goal could not be canceled: it means all of them.
        known = id == states.NO_ID or id in self._table
        accepted = not known and self._agrees(self._handler.decide, request.goal)
        state = self._table.accept(id, stamp) if accepted else None
        goal = None if state is None else ServerGoal(self, state, request.goal, self._goal.client(origin))
        response = self._type.SendGoal.Response(accepted, states.to_time(stamp if accepted else 0))
        self._goal.reply(origin, codec.serialize(response))
        if goal is not None:
            self._active[id] = goal
            self._news = True
            try:
                self._handler.accepted(goal)
            except Exception as error:  # a user's handler may raise anything
                self._endpoints.guard.caught(f"Action '{self.name}'", error)
                if goal.status is states.GoalStatus.ACCEPTED:
                    goal.execute()
                if goal.status.active:
                    goal.abort(self._type.Result())

    def _agrees(self, decide: Callable[[Any], bool], about: Any) -> bool:
        """Return what the handler decides; one that raises does not agree."""
        try:
            return bool(decide(about))
        except Exception as error:  # a user's handler may raise anything
            self._endpoints.guard.caught(f"Action '{self.name}'", error)
            return False

    def _on_cancel(self, origin: Origin, request: CancelGoal_Request) -> None:
        info = request.goal_info
        code, meant = self._table.to_cancel(states.from_uuid(info.goal_id), states.from_time(info.stamp))
        canceling: list[states.GoalState] = []
        for goal in meant:
            # Asked about this one or the one before, the handler may have ended it.
            agreed = goal.cancelable and self._agrees(self._handler.cancel, self._active[goal.id])
            if agreed and goal.cancelable:
                self.update(goal, states.GoalEvent.CANCEL_GOAL)
                canceling.append(goal)
        if meant and not canceling:
            code = states.CancelCode.REJECTED
        response = CancelGoal_Response(int(code), [states.goal_info(g.id, g.stamp) for g in canceling])
        self._cancel.reply(origin, codec.serialize(response))

    def _on_result(self, origin: Origin, request: Any) -> None:
        id = states.from_uuid(request.goal_id)
        if id in self._active:
            self._waiting.setdefault(id, deque(maxlen=MAX_WAITING)).append(origin)
        elif id in self._results:
            self._result.reply(origin, self._results[id])
        else:
            response = self._type.GetResult.Response(int(states.GoalStatus.UNKNOWN), self._type.Result())
            self._result.reply(origin, codec.serialize(response))
