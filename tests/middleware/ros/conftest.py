"""Nodes on each transport, in one process."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from golem.middleware.dds.base import Participant
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.graph import PARTICIPANT_USER_DATA
from golem.middleware.ros.node import DdsNode
from golem.middleware.ros.rclpy_node import RclpyNode

PICK = "golem_interfaces/action/Pick"
SET_BOOL = "std_srvs/srv/SetBool"
STRING = "std_msgs/msg/String"
TIMEOUT = 10.0


class Clock:
    """Time that a test sets [s]."""

    def __init__(self) -> None:
        self.t = 100.0

    def __call__(self) -> float:
        return self.t


class World:
    """Makes nodes, each with its own participant, and spins them."""

    def __init__(self, join: Callable[[], Participant] | None, pause: float, domain: int = 0) -> None:
        """Take participants from `join`, or nodes of rclpy on `domain`; `pause` [s] between looks at the network."""
        self._join, self._pause, self._domain = join, pause, domain
        self._participants: dict[DdsNode, Participant | None] = {}
        self._clock = Clock()

    @property
    def clock(self) -> Clock:
        """The clock of all nodes."""
        if self._join is None:
            pytest.skip("rclpy has a clock of its own")
        return self._clock

    def participant(self, node: DdsNode) -> Participant:
        """The participant of a node, to do with it what no node does."""
        participant = self._participants[node]
        return participant if participant is not None else pytest.skip("rclpy hides its participant")

    def node(self, name: str, namespace: str = "/") -> DdsNode:
        """A new node; over rclpy it only looks like one of ours."""
        if self._join is None:
            node: Any = RclpyNode(name, namespace, self._domain)
            self._participants[node] = None
            return node
        participant = self._join()
        node = DdsNode(participant, name, namespace, now=self._clock)
        self._participants[node] = participant
        return node

    def kill(self, node: DdsNode) -> None:
        """Take a node away, over DDS without its doing anything about it."""
        (self._participants.pop(node) or node).close()

    def unspun(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition()` without spinning anything."""
        if self._join is None:
            pytest.skip("rclpy takes nothing in unless it is spun")
        end = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < end, "nothing happened for too long"
            time.sleep(0.0005)

    def until(self, condition: Callable[[], bool]) -> None:
        """Spin all nodes until `condition()`."""
        end = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < end, "nothing happened for too long"
            if not self.spin():
                time.sleep(0.0005)

    def spin(self) -> int:
        """Poll every node once."""
        return sum(node.poll() for node in self._participants)

    def settle(self) -> None:
        """Spin until nothing more arrives; over the network that takes a while to know."""
        quiet = 0
        while quiet < 20:
            quiet = 0 if self.spin() else quiet + 1
            time.sleep(self._pause)

    def get(self, future: Any) -> Any:
        """Spin until `future` is done and return its value."""
        self.until(lambda: future.done)
        return future.result()

    def close(self) -> None:
        """Take everything away."""
        for node, participant in self._participants.items():
            node.close()
            if participant is not None:
                participant.close()
        self._participants.clear()


TRANSPORTS = ("local", "cyclone", "rclpy") if importlib.util.find_spec("rclpy") else ("local", "cyclone")


@pytest.fixture(params=TRANSPORTS)
def world(request: pytest.FixtureRequest, domain: int) -> Iterator[World]:
    """Nodes on each transport."""
    if request.param == "local":
        world = World(LocalDomain().participant, 0.0)
    elif request.param == "cyclone":
        pytest.importorskip("cyclonedds")
        from golem.middleware.dds.connect import connect
        from golem.middleware.dds.domain import DdsConfig

        config = DdsConfig(domain=domain)
        world = World(lambda: connect(config, PARTICIPANT_USER_DATA), 0.005)
    else:
        world = World(None, 0.005, domain)
    yield world
    world.close()
