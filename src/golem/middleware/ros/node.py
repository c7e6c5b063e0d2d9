"""A ROS 2 node over the DDS transport, without ROS."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

from golem.middleware.dds.base import DEFAULT, Participant, Qos
from golem.middleware.ros import names, parameters
from golem.middleware.ros.action_client import DdsActionClient
from golem.middleware.ros.action_server import DdsActionServer
from golem.middleware.ros.base import RESULT_TIMEOUT, ActionHandler
from golem.middleware.ros.callback_guard import CallbackGuard, log_error
from golem.middleware.ros.codec import DEFAULT_DISTRO
from golem.middleware.ros.future import LOOK, Future, spin_until
from golem.middleware.ros.graph import DiscoveryInfo
from golem.middleware.ros.node_endpoints import NodeEndpoints
from golem.middleware.ros.pubsub import DdsPublisher, DdsSubscription
from golem.middleware.ros.service import DdsClient, DdsService

T = TypeVar("T")


class DdsNode:
    """The one node of a participant; see `base.Node`.

    Attributes:
        name: without namespace.
        namespace: absolute, or `/`.
        now: the node's clock [s].
        guard: keeps what callbacks raise.
    """

    def __init__(
        self,
        participant: Participant,
        name: str,
        namespace: str = "/",
        distro: str = DEFAULT_DISTRO,
        now: Callable[[], float] = time.time,
        log: Callable[[str], None] = log_error,
    ) -> None:
        """Join the ROS graph.

        Args:
            participant: member of a DDS domain, with `graph.PARTICIPANT_USER_DATA`; closed by whoever made it.
            name: one token.
            namespace: absolute, or `/`.
            distro: whose `ros2 node list` shall show the node: `"humble"`, or `"jazzy"` for all since.
            now: the clock that goals are stamped by [s].
            log: what callbacks raise is said by; see `CallbackGuard`.

        Raises:
            ConfigError: name, namespace or distro is invalid.
        """
        self.name, self.namespace, self.now = names.check_node(name), names.check_namespace(namespace), now
        self.guard = CallbackGuard(log)
        info = DiscoveryInfo(participant, namespace, name, distro)
        self._endpoints = NodeEndpoints(participant, info, self.guard)
        for service, (kind, answer) in parameters.SERVICES.items():
            self.service(f"~/{service}", f"rcl_interfaces/srv/{kind}", answer)

    def publisher(self, topic: str, type: str, qos: Qos = DEFAULT) -> DdsPublisher:
        """Publish messages of `type` on `topic`."""
        return DdsPublisher(self._endpoints, self._resolve(topic), type, qos)

    def subscription(
        self, topic: str, type: str, callback: Callable[[Any], None] | None = None, qos: Qos = DEFAULT
    ) -> DdsSubscription:
        """Receive messages of `type` on `topic`."""
        return DdsSubscription(self._endpoints, self._resolve(topic), type, callback, qos)

    def client(self, service: str, type: str) -> DdsClient:
        """Call a service."""
        return DdsClient(self._endpoints, self._resolve(service), type)

    def service(self, service: str, type: str, callback: Callable[[Any], Any]) -> DdsService:
        """Offer a service."""
        return DdsService(self._endpoints, self._resolve(service), type, callback)

    def action_client(self, action: str, type: str) -> DdsActionClient:
        """Give goals to an action."""
        return DdsActionClient(self._endpoints, self._resolve(action), type)

    def action_server(
        self, action: str, type: str, handler: ActionHandler, result_timeout: float = RESULT_TIMEOUT
    ) -> DdsActionServer:
        """Offer an action."""
        return DdsActionServer(
            self._endpoints, self._resolve(action), type, handler, self.now, result_timeout
        )

    def poll(self) -> int:
        """Handle what has arrived; see `base.Node.poll`."""
        return self._endpoints.poll()

    def spin_once(self, timeout: float) -> int:
        """Wait up to `timeout` [s] until something has arrived, then do as `poll`."""
        end = time.monotonic() + timeout
        while True:
            handled = self.poll()
            left = end - time.monotonic()
            if handled or left <= 0.0:
                return handled
            self._endpoints.waitset.wait(min(left, LOOK))

    def wait(self, future: Future[T], timeout: float) -> T:
        """Spin until `future` is done; see `base.Node.wait`."""
        return spin_until(self, future, timeout)

    def close(self) -> None:
        """Close everything the node has made and leave the graph."""
        self._endpoints.close_all()

    def _resolve(self, name: str) -> str:
        return names.resolve(name, self.name, self.namespace)
