"""The same node contract over rclpy, for machines with ROS 2: the best neighbour of Nav2 and rviz2.

rclpy is not on the package index; it comes with ROS 2 and is imported by the `rclpy_*` modules only. Messages are
converted through their CDR, so that users see the classes of `codec` either way. rclpy owns the middleware: not only
callbacks, `Subscription.latest` too is only renewed when the node is spun.

These modules have never been run: no ROS 2 was at hand. `tests/middleware/ros` runs the conformance suite on them
wherever rclpy can be imported.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

from golem.middleware.dds.base import DEFAULT, Qos
from golem.middleware.ros import codec, names
from golem.middleware.ros.base import RESULT_TIMEOUT, ActionHandler
from golem.middleware.ros.future import Future, RosError, spin_until
from golem.middleware.ros.goal_info import CANCEL_GOAL
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.rclpy_actions import RclpyActionClient, RclpyActionServer
from golem.middleware.ros.rclpy_types import (
    Closing,
    Counter,
    from_rclpy,
    qos_profile,
    rclpy_module,
    rclpy_type,
    to_rclpy,
)
from golem.middleware.ros.typed import check, serialize

T = TypeVar("T")
E = TypeVar("E", bound="Made")
AT_ONCE = 1000
"""Callbacks that one poll runs at most."""
NAP = 0.001
"""Pause between two looks [s]: while a goal is pursued rclpy's executor always has its coroutine to resume, and does
not wait."""


class RclpyPublisher(Closing):
    """Sends messages on one topic; see `base.Publisher`."""

    def __init__(self, ros: Any, name: str, type: str, qos: Qos) -> None:
        """Publish messages of `type` on the topic with absolute `name`, for rclpy's node `ros`."""
        self.name, self._ros, self._kind = name, ros, codec.message(type)
        self._publisher = ros.create_publisher(rclpy_type(type), name, qos_profile(qos))

    def publish(self, message: Any) -> None:
        """Send one message."""
        self._publisher.publish(serialize(f"Topic '{self.name}'", message, self._kind))

    def matched(self) -> int:
        """Return how many subscriptions are known to listen now."""
        return self._publisher.get_subscription_count()

    def _leave(self) -> None:
        self._ros.destroy_publisher(self._publisher)


class RclpySubscription(Closing):
    """Receives the messages of one topic; see `base.Subscription`.

    Attributes:
        malformed: samples that were no message of the topic's type.
    """

    def __init__(
        self, ros: Any, name: str, type: str, callback: Callable[[Any], None] | None, qos: Qos, count: Counter
    ) -> None:
        """Give messages of `type` on the topic with absolute `name` to `callback`, if there is one."""
        self.name, self.malformed = name, 0
        self._ros, self._kind, self._callback, self._handled = ros, codec.message(type), callback, count
        self._latest: Any | None = None
        self._count = 0
        self._subscription = ros.create_subscription(
            rclpy_type(type), name, self._take, qos_profile(qos), raw=True
        )

    def latest(self) -> Any | None:
        """Return the newest message, or None before the first."""
        return self._latest

    def count(self) -> int:
        """Return how many messages have come so far."""
        return self._count

    def matched(self) -> int:
        """Return how many publishers are known now."""
        return self._ros.count_publishers(self.name)

    def _leave(self) -> None:
        self._ros.destroy_subscription(self._subscription)

    def _take(self, payload: bytes) -> None:
        self._handled.up()
        try:
            self._latest = codec.deserialize(payload, self._kind)
        except CodecError:
            self.malformed += 1
            return
        self._count += 1
        if self._callback is not None:
            self._callback(self._latest)


class RclpyClient(Closing):
    """Calls one service; see `base.Client`."""

    def __init__(self, ros: Any, name: str, type: str, count: Counter) -> None:
        """Call the service with absolute `name`."""
        self.name, self._ros, self._handled = name, ros, count
        self._type, self._ros_type = codec.service(type), rclpy_type(type)
        self._client = ros.create_client(self._ros_type, name)
        self._pending: dict[Any, Future[Any]] = {}

    def ready(self) -> bool:
        """Return whether a server is there."""
        return self._client.service_is_ready()

    def call(self, request: Any) -> Future[Any]:
        """Send a request; see `base.Client.call`."""
        check(f"Service '{self.name}'", request, self._type.Request)
        if not self.ready():
            failed: Future[Any] = Future()
            failed.fail(RosError(f"No server of '{self.name}' is there."))
            return failed
        asked = self._client.call_async(to_rclpy(request, self._ros_type.Request))
        future: Future[Any] = Future(lambda: self._forget(asked))
        self._pending[asked] = future
        asked.add_done_callback(self._answered)
        return future

    def keep(self) -> None:
        """Give up on what will not be answered any more; called at every poll."""
        if self._pending and not self.ready():
            self._give_up(f"The server of '{self.name}' has gone.")

    def _leave(self) -> None:
        self._give_up(f"The client of '{self.name}' was closed.")
        self._ros.destroy_client(self._client)

    def _answered(self, asked: Any) -> None:
        self._handled.up()
        future = self._pending.pop(asked, None)
        if future is not None:
            future.complete(from_rclpy(asked.result(), self._type.Response))

    def _forget(self, asked: Any) -> None:
        if self._pending.pop(asked, None) is not None:
            self._client.remove_pending_request(asked)

    def _give_up(self, reason: str) -> None:
        for future in list(self._pending.values()):
            future.cancel(reason)


class RclpyService(Closing):
    """Answers the requests of one service; see `base.Service`."""

    def __init__(
        self, ros: Any, name: str, type: str, callback: Callable[[Any], Any], count: Counter
    ) -> None:
        """Answer requests for the service with absolute `name` by what `callback` returns."""
        self.name, self._ros, self._callback, self._handled = name, ros, callback, count
        self._type, self._ros_type = codec.service(type), rclpy_type(type)
        self._service = ros.create_service(self._ros_type, name, self._answer)

    def _leave(self) -> None:
        self._ros.destroy_service(self._service)

    def _answer(self, request: Any, _: Any) -> Any:
        self._handled.up()
        response = self._callback(from_rclpy(request, self._type.Request))
        check(f"Service '{self.name}'", response, self._type.Response)
        return to_rclpy(response, self._ros_type.Response)


Made = RclpyPublisher | RclpySubscription | RclpyClient | RclpyService | RclpyActionClient | RclpyActionServer


class RclpyNode:
    """A node of rclpy; see `base.Node`.

    Attributes:
        name: without namespace.
        namespace: absolute, or `/`.
        ros: rclpy's node.
    """

    def __init__(self, name: str, namespace: str = "/", domain: int | None = None) -> None:
        """Join the ROS graph, in a context of its own.

        Args:
            name: one token.
            namespace: absolute, or `/`.
            domain: DDS domain; None takes ROS_DOMAIN_ID.

        Raises:
            MissingSystemLibrary: ROS 2 is not installed.
            ConfigError: name or namespace is invalid.
        """
        rclpy, signals = rclpy_module("rclpy"), rclpy_module("rclpy.signals")
        self.name, self.namespace = names.check_node(name), names.check_namespace(namespace)
        self._context = rclpy_module("rclpy.context").Context()
        no_signals = signals.SignalHandlerOptions.NO
        rclpy.init(context=self._context, domain_id=domain, signal_handler_options=no_signals)
        self.ros = rclpy.create_node(name, namespace=namespace, context=self._context)
        self._executor = rclpy_module("rclpy.executors").SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.ros)
        self._handled = Counter()
        self._made: list[Made] = []
        self._open = True

    def publisher(self, topic: str, type: str, qos: Qos = DEFAULT) -> RclpyPublisher:
        """Publish messages of `type` on `topic`."""
        return self._keep(RclpyPublisher(self.ros, self._resolve(topic), type, qos))

    def subscription(
        self, topic: str, type: str, callback: Callable[[Any], None] | None = None, qos: Qos = DEFAULT
    ) -> RclpySubscription:
        """Receive messages of `type` on `topic`."""
        name = self._resolve(topic)
        return self._keep(RclpySubscription(self.ros, name, type, callback, qos, self._handled))

    def client(self, service: str, type: str) -> RclpyClient:
        """Call a service."""
        return self._keep(RclpyClient(self.ros, self._resolve(service), type, self._handled))

    def service(self, service: str, type: str, callback: Callable[[Any], Any]) -> RclpyService:
        """Offer a service."""
        return self._keep(RclpyService(self.ros, self._resolve(service), type, callback, self._handled))

    def action_client(self, action: str, type: str) -> RclpyActionClient:
        """Give goals to an action."""
        name = self._resolve(action)
        cancel = self.client(names.action(name).cancel_goal, CANCEL_GOAL)
        return self._keep(RclpyActionClient(self.ros, name, type, cancel, self._handled))

    def action_server(
        self, action: str, type: str, handler: ActionHandler, result_timeout: float = RESULT_TIMEOUT
    ) -> RclpyActionServer:
        """Offer an action."""
        name = self._resolve(action)
        return self._keep(RclpyActionServer(self.ros, name, type, handler, result_timeout, self._handled))

    def now(self) -> float:
        """Return the time on the node's clock [s]; that of /clock if the node's parameter `use_sim_time` is set."""
        return self.ros.get_clock().now().nanoseconds * 1e-9

    def poll(self) -> int:
        """Handle what has arrived; see `base.Node.poll`."""
        before = self._handled.value
        for _ in range(AT_ONCE):
            seen = self._handled.value
            self._executor.spin_once(timeout_sec=0.0)
            if self._handled.value == seen:
                break
        for made in list(self._made):
            if isinstance(made, RclpyClient | RclpyActionClient):
                made.keep()
        return self._handled.value - before

    def spin_once(self, timeout: float) -> int:
        """Wait up to `timeout` [s] until something has arrived, then do as `poll`."""
        end = time.monotonic() + timeout
        while True:
            handled = self.poll()
            if handled or time.monotonic() >= end:
                return handled
            time.sleep(NAP)

    def wait(self, future: Future[T], timeout: float) -> T:
        """Spin until `future` is done; see `base.Node.wait`."""
        return spin_until(self, future, timeout)

    def close(self) -> None:
        """Close everything the node has made and leave the graph."""
        if not self._open:
            return
        self._open = False
        made, self._made = self._made, []
        for each in made:
            each.close()
        self._executor.shutdown()
        self.ros.destroy_node()
        rclpy_module("rclpy").shutdown(context=self._context)

    def _resolve(self, name: str) -> str:
        if not self._open:
            raise RosError("The node is closed; create another one.")
        return names.resolve(name, self.name, self.namespace)

    def _keep(self, made: E) -> E:
        self._made = [each for each in self._made if not each.closed]
        self._made.append(made)
        return made
