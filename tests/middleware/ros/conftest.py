"""Nodes on each transport, in one process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from golem.middleware.dds.base import Participant
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.node_endpoints import PARTICIPANT_USER_DATA

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

    def __init__(self, join: Callable[[], Participant], pause: float) -> None:
        """Take participants from `join`; `pause` [s] between looks at the network."""
        self._join, self._pause = join, pause
        self._participants: dict[RosNode, Participant] = {}
        self.clock = Clock()

    def participant(self, node: RosNode) -> Participant:
        """The participant of a node, to do with it what no node does."""
        return self._participants[node]

    def node(self, name: str, namespace: str = "/") -> RosNode:
        """A new node."""
        participant = self._join()
        node = RosNode(participant, name, namespace, now=self.clock)
        self._participants[node] = participant
        return node

    def kill(self, node: RosNode) -> None:
        """Take a node away without its doing anything about it."""
        self._participants.pop(node).close()

    def unspun(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition()` without spinning anything."""
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
            participant.close()
        self._participants.clear()


@pytest.fixture(params=("local", "cyclone"))
def world(request: pytest.FixtureRequest, domain: int) -> Iterator[World]:
    """Nodes on each transport."""
    if request.param == "local":
        world = World(LocalDomain().participant, 0.0)
    else:
        pytest.importorskip("cyclonedds")
        from golem.middleware.dds.connect import connect
        from golem.middleware.dds.domain import DdsConfig

        config = DdsConfig(domain=domain)
        world = World(lambda: connect(config, PARTICIPANT_USER_DATA), 0.005)
    yield world
    world.close()
