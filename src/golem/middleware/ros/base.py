"""The contract of a ROS 2 node: topics, services and actions, whatever carries them.

Nodes are passive: nothing of the user's runs but inside `poll` and `spin_once`, in the caller's thread. Over DDS, what
a callback raises is logged and goes no further: a service then answers with zeros, a goal is aborted. Types go by
their ROS names (`std_msgs/msg/String`, `std_srvs/srv/SetBool`, `golem_interfaces/action/Pick`); messages are the
classes of `golem.middleware.ros.codec`. Names are absolute, relative to the node's namespace, or private (`~/x`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from golem.middleware.dds.base import DEFAULT, Qos
from golem.middleware.ros.future import Future
from golem.middleware.ros.goals import NO_ID, CancelCode, GoalStatus

T = TypeVar("T")

RESULT_TIMEOUT = 10.0
"""How long an action's result is kept after its goal has ended [s]; rcl_action's default (action_server.c)."""


class Publisher(Protocol):
    """Sends messages on one topic."""

    def publish(self, message: Any) -> None:
        """Send one message of the topic's type."""
        ...

    def matched(self) -> int:
        """Return how many subscriptions are known to listen now."""
        ...

    def close(self) -> None:
        """Stop; calling it again does nothing."""
        ...


class Subscription(Protocol):
    """Receives the messages of one topic."""

    def latest(self) -> Any | None:
        """Return the newest message, or None before the first; over DDS this needs no spinning."""
        ...

    def count(self) -> int:
        """Return how many messages have come so far: a reader sees by it that one is new."""
        ...

    def matched(self) -> int:
        """Return how many publishers are known now."""
        ...

    def close(self) -> None:
        """Stop; calling it again does nothing."""
        ...


class Client(Protocol):
    """Calls one service."""

    def ready(self) -> bool:
        """Return whether a server is there."""
        ...

    def call(self, request: Any) -> Future[Any]:
        """Send a request; the future brings the response.

        It fails when no server is there or the server goes away; a server that does not answer is the caller's to
        give up on, with `RosNode.wait` or `Future.cancel`.
        """
        ...

    def close(self) -> None:
        """Stop; what is unanswered fails. Calling it again does nothing."""
        ...


class Service(Protocol):
    """Answers the requests of one service."""

    def close(self) -> None:
        """Stop; calling it again does nothing."""
        ...


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a goal ended.

    Attributes:
        status: SUCCEEDED, CANCELED or ABORTED; UNKNOWN if the server does not know the goal (any more).
        result: the action's result message; of no meaning if the status is UNKNOWN.
    """

    status: GoalStatus
    result: Any


@dataclass(frozen=True, slots=True)
class Canceling:
    """Answer to a request to cancel.

    Attributes:
        code: whether the server agreed.
        goals: ids of the goals that are canceling now; whether they end so, their outcomes tell.
    """

    code: CancelCode
    goals: tuple[bytes, ...]


class ClientGoal(Protocol):
    """A goal as its client sees it. Keep it as long as its feedback or status matters."""

    @property
    def id(self) -> bytes:
        """16 bytes."""
        ...

    @property
    def accepted(self) -> bool:
        """Whether the server took the goal on."""
        ...

    @property
    def status(self) -> GoalStatus:
        """The newest the server said; UNKNOWN before that."""
        ...

    def result(self) -> Future[Outcome]:
        """Ask for the outcome; the future brings it once the goal has ended."""
        ...

    def cancel(self) -> Future[Canceling]:
        """Ask the server to cancel the goal."""
        ...


class ActionClient(Protocol):
    """Gives goals to one action."""

    def ready(self) -> bool:
        """Return whether a server with all its services and topics is there."""
        ...

    def send_goal(
        self, goal: Any, feedback: Callable[[Any], None] | None = None, id: bytes | None = None
    ) -> Future[ClientGoal]:
        """Propose a goal; the future brings the server's decision.

        Args:
            goal: the action's goal message.
            feedback: called with each of the goal's feedback messages.
            id: 16 bytes to know it by; random if None.
        """
        ...

    def cancel(self, id: bytes = NO_ID, before: float = 0.0) -> Future[Canceling]:
        """Ask to cancel goals, of any client: all; or that with `id`; or those accepted at or before a time, and `id`.

        Args:
            id: 16 bytes of a goal, or `NO_ID`.
            before: time on the server's clock [s]; 0 for none.
        """
        ...

    def close(self) -> None:
        """Stop; what is unanswered fails. Calling it again does nothing."""
        ...


class ServerGoal(Protocol):
    """A goal as its server pursues it: active until it ends as succeeded, aborted or canceled."""

    @property
    def id(self) -> bytes:
        """16 bytes."""
        ...

    @property
    def request(self) -> Any:
        """The action's goal message."""
        ...

    @property
    def client(self) -> bytes:
        """12 bytes, the same for all that one process of the sender's asks for; empty where nobody knows."""
        ...

    def attended(self) -> bool:
        """Return whether whoever sent it is still there."""
        ...

    @property
    def status(self) -> GoalStatus:
        """Where it stands; CANCELING once a request to cancel was accepted."""
        ...

    def execute(self) -> None:
        """Say that work on it begins; needed before it can succeed or be aborted, unless it is canceling.

        Raises:
            RosError: it is not waiting to be executed.
        """
        ...

    def feedback(self, feedback: Any) -> None:
        """Send a feedback message.

        Raises:
            RosError: the goal has ended.
        """
        ...

    def succeed(self, result: Any) -> None:
        """End it: reached.

        Raises:
            RosError: it is neither executing nor canceling.
        """
        ...

    def abort(self, result: Any) -> None:
        """End it: failed.

        Raises:
            RosError: it is neither executing nor canceling.
        """
        ...

    def canceled(self, result: Any) -> None:
        """End it: given up as was asked.

        Raises:
            RosError: it is not canceling.
        """
        ...


class ActionHandler(Protocol):
    """Decides about the goals of an action; pursuing them is the business of whoever keeps the `ServerGoal`s."""

    def decide(self, request: Any) -> bool:
        """Return whether to take on a goal, given its goal message."""
        ...

    def accepted(self, goal: ServerGoal) -> None:
        """Take charge of a goal; its client knows by now that it was accepted."""
        ...

    def cancel(self, goal: ServerGoal) -> bool:
        """Return whether to agree that `goal` be canceled; if so it is canceling when this has returned."""
        ...


class ActionServer(Protocol):
    """Offers one action."""

    def goals(self) -> list[ServerGoal]:
        """Return the goals that have not ended, oldest first."""
        ...

    def close(self) -> None:
        """Stop; goals that have not ended never will. Calling it again does nothing."""
        ...


class RosNode(Protocol):
    """A named member of the ROS graph.

    Attributes:
        name: without namespace.
        namespace: absolute, or `/`.
    """

    name: str
    namespace: str

    def publisher(self, topic: str, type: str, qos: Qos = DEFAULT) -> Publisher:
        """Publish messages of `type` on `topic`.

        Raises:
            ConfigError: the name is invalid, or the type unknown; so for everything below.
        """
        ...

    def subscription(
        self, topic: str, type: str, callback: Callable[[Any], None] | None = None, qos: Qos = DEFAULT
    ) -> Subscription:
        """Receive messages of `type` on `topic`; `callback` gets each of the last `qos.depth` when the node is spun."""
        ...

    def client(self, service: str, type: str) -> Client:
        """Call a service."""
        ...

    def service(self, service: str, type: str, callback: Callable[[Any], Any]) -> Service:
        """Offer a service; `callback` returns the response to a request."""
        ...

    def action_client(self, action: str, type: str) -> ActionClient:
        """Give goals to an action."""
        ...

    def action_server(
        self, action: str, type: str, handler: ActionHandler, result_timeout: float = RESULT_TIMEOUT
    ) -> ActionServer:
        """Offer an action whose results are kept for `result_timeout` [s] after their goals have ended."""
        ...

    def now(self) -> float:
        """Return the time on the node's clock [s]."""
        ...

    def poll(self) -> int:
        """Handle what has arrived, and return how many messages, requests and answers that was."""
        ...

    def spin_once(self, timeout: float) -> int:
        """Wait up to `timeout` [s] until something has arrived, then do as `poll`."""
        ...

    def wait(self, future: Future[T], timeout: float) -> T:
        """Spin until `future` is done and return its value; after `timeout` [s] it is given up.

        Raises:
            RosError: it failed, or did not arrive in time.
        """
        ...

    def close(self) -> None:
        """Close everything the node has made and leave the graph; calling it again does nothing."""
        ...
