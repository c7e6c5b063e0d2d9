"""A ROS 2 node over the DDS transport, without ROS: topics, services and actions, between machines or in one process.

Nodes are passive: nothing of the user's runs but inside `poll` and `spin_once`, in the caller's thread. What a callback
raises is logged and goes no further: a service then answers with zeros, a goal is aborted. Types go by their ROS names
(`std_msgs/msg/String`, `std_srvs/srv/SetBool`, `golem_interfaces/action/Pick`); messages are the classes of
`golem.middleware.ros.codec`. Names are absolute, relative to the node's namespace, or private (`~/x`).

The parameter services that every ROS 2 node has, for nodes that have no parameters.

`ros2 param list` and its like wait for them at every node they see, until a timeout where there are none. The options
of GOLEM's modules are in its stack files and hold for a whole run: nothing can be set here, and the answer says so.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from golem.middleware.dds.base import DEFAULT, Participant, Qos
from golem.middleware.ros import names
from golem.middleware.ros.action_client import ActionClient
from golem.middleware.ros.action_server import RESULT_TIMEOUT, ActionHandler, ActionServer
from golem.middleware.ros.callback_guard import CallbackGuard, log_error
from golem.middleware.ros.codec import DEFAULT_DISTRO
from golem.middleware.ros.future import Future
from golem.middleware.ros.msgs import rcl_interfaces as rcl
from golem.middleware.ros.node_endpoints import DiscoveryInfo, NodeEndpoints
from golem.middleware.ros.pubsub import Publisher, Subscription
from golem.middleware.ros.service import Client, Service

REFUSED = rcl.SetParametersResult(
    False, "GOLEM has no ROS parameters; the options of its modules are in the stack file."
)
SERVICES: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "list_parameters": ("ListParameters", lambda _: rcl.ListParameters_Response()),
    "get_parameters": (
        "GetParameters",
        lambda asked: rcl.GetParameters_Response([rcl.ParameterValue() for _ in asked.names]),
    ),
    "get_parameter_types": (
        "GetParameterTypes",
        lambda asked: rcl.GetParameterTypes_Response(np.zeros(len(asked.names), np.uint8)),
    ),
    "describe_parameters": (
        "DescribeParameters",
        lambda asked: rcl.DescribeParameters_Response([rcl.ParameterDescriptor(n) for n in asked.names]),
    ),
    "set_parameters": ("SetParameters", lambda asked: rcl.SetParameters_Response([REFUSED for _ in asked.parameters])),
    "set_parameters_atomically": ("SetParametersAtomically", lambda _: rcl.SetParametersAtomically_Response(REFUSED)),
}
"""Name within the node, short type name, and what answers."""


T = TypeVar("T")
LOOK = 0.02
"""How often a waiting node looks after what no sample announces, e.g. that a server has gone [s]."""


class RosNode:
    """A named member of the ROS graph, the one node of its participant.

    Attributes:
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
        """Join the ROS graph. Raises ConfigError: name, namespace or distro is invalid.

        Args:
            participant: member of a DDS domain, with `graph.PARTICIPANT_USER_DATA`; closed by whoever made it.
            name: one token.
            namespace: absolute, or `/`.
            distro: whose `ros2 node list` shall show the node: `"humble"`, or `"jazzy"` for all since.
            now: the clock that goals are stamped by [s].
            log: what callbacks raise is said by; see `CallbackGuard`.
        """
        self.name, self.namespace, self.now = names.check_node(name), names.check_namespace(namespace), now
        self.guard = CallbackGuard(log)
        info = DiscoveryInfo(participant, namespace, name, distro)
        self._endpoints = NodeEndpoints(participant, info, self.guard)
        for service, (kind, answer) in SERVICES.items():
            self.service(f"~/{service}", f"rcl_interfaces/srv/{kind}", answer)

    def publisher(self, topic: str, type: str, qos: Qos = DEFAULT) -> Publisher:
        """Publish messages of `type` on `topic`. Raises ConfigError, as all below: an invalid name or unknown type."""
        return Publisher(self._endpoints, self._resolve(topic), type, qos)

    def subscription(
        self, topic: str, type: str, callback: Callable[[Any], None] | None = None, qos: Qos = DEFAULT
    ) -> Subscription:
        """Receive messages of `type` on `topic`; `callback` gets each of the last `qos.depth` when the node is spun."""
        return Subscription(self._endpoints, self._resolve(topic), type, callback, qos)

    def client(self, service: str, type: str) -> Client:
        """Call a service."""
        return Client(self._endpoints, self._resolve(service), type)

    def service(self, service: str, type: str, callback: Callable[[Any], Any]) -> Service:
        """Offer a service; `callback` returns the response to a request."""
        return Service(self._endpoints, self._resolve(service), type, callback)

    def action_client(self, action: str, type: str) -> ActionClient:
        """Give goals to an action."""
        return ActionClient(self._endpoints, self._resolve(action), type)

    def action_server(
        self, action: str, type: str, handler: ActionHandler, result_timeout: float = RESULT_TIMEOUT
    ) -> ActionServer:
        """Offer an action whose results are kept for `result_timeout` [s] after their goals have ended."""
        return ActionServer(self._endpoints, self._resolve(action), type, handler, self.now, result_timeout)

    def poll(self) -> int:
        """Handle what has arrived, and return how many messages, requests and answers that was."""
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
        """Spin until `future` is done and return its value. Raises RosError: it failed, or took over `timeout` [s]."""
        end = time.monotonic() + timeout
        while not future.done:
            left = end - time.monotonic()
            if left <= 0.0:
                future.cancel(f"No answer within {timeout:g} s.")
            else:
                self.spin_once(min(left, LOOK))
        return future.result()

    def close(self) -> None:
        """Close everything the node has made and leave the graph; calling it again does nothing."""
        self._endpoints.close_all()

    def _resolve(self, name: str) -> str:
        return names.resolve(name, self.name, self.namespace)
