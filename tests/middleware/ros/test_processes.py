"""A service and an action between two real processes over DDS, and what the death of one of them means."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rosbags")

from golem.middleware.ros.action_client import ActionClient
from golem.middleware.ros.codec import action, service
from golem.middleware.ros.future import RosError
from golem.middleware.ros.goals import CancelCode, GoalStatus
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.node_endpoints import PARTICIPANT_USER_DATA

from .conftest import PICK, SET_BOOL

pytest.importorskip("cyclonedds")

PEER = Path(__file__).with_name("peer.py")
STAGES = ["detect", "approach", "grasp", "pull"]
TIMEOUT = 20.0
Pick, SetBool = action(PICK), service(SET_BOOL)


class Peer:
    """The other process."""

    def __init__(self, domain: int) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(PEER), str(domain)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "ready\n"

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()

    def end(self) -> int:
        """Ask it to end, and return its exit status."""
        self._process.communicate(timeout=TIMEOUT)
        return self._process.returncode


@pytest.fixture
def node(domain: int) -> Iterator[RosNode]:
    from golem.middleware.dds.connect import connect
    from golem.middleware.dds.domain import DdsConfig

    participant = connect(DdsConfig(domain=domain), PARTICIPANT_USER_DATA)
    node = RosNode(participant, "here")
    yield node
    node.close()
    participant.close()


def reach(node: RosNode, client: ActionClient) -> None:
    for _ in range(400):
        if client.ready():
            return
        node.spin_once(0.05)
    raise AssertionError("the peer was not found")


def test_a_service_and_an_action_between_two_processes(node: RosNode, domain: int) -> None:
    peer = Peer(domain)
    setter, picker = node.client("set", SET_BOOL), node.action_client("pick", PICK)
    reach(node, picker)
    assert setter.ready()
    assert node.wait(setter.call(SetBool.Request(True)), TIMEOUT) == SetBool.Response(True, "from another process")

    stages: list[str] = []
    goal = node.wait(picker.send_goal(Pick.Goal("screw"), lambda f: stages.append(f.feedback.stage)), TIMEOUT)
    assert goal.accepted
    outcome = node.wait(goal.result(), TIMEOUT)
    assert (outcome.status, outcome.result.result.stage) == (GoalStatus.SUCCEEDED, "done")
    assert stages == STAGES
    assert not node.wait(picker.send_goal(Pick.Goal("")), TIMEOUT).accepted

    endless = node.wait(picker.send_goal(Pick.Goal("forever")), TIMEOUT)
    ended = endless.result()
    assert node.wait(endless.cancel(), TIMEOUT).code is CancelCode.NONE
    assert node.wait(ended, TIMEOUT).result.result.stage == "cancelled"
    assert peer.end() == 0
    with pytest.raises(RosError, match="No server of '/set' is there|has gone"):
        node.wait(setter.call(SetBool.Request(True)), TIMEOUT)


@pytest.mark.slow
@pytest.mark.parametrize("at_once", [False, True], ids=["after its lease", "within its lease"])
def test_a_killed_server_is_missed_and_its_successor_found(node: RosNode, domain: int, at_once: bool) -> None:
    peer = Peer(domain)
    picker = node.action_client("pick", PICK)
    reach(node, picker)
    goal = node.wait(picker.send_goal(Pick.Goal("forever")), TIMEOUT)
    outcome = goal.result()
    peer.kill()
    successor = Peer(domain) if at_once else None
    # Nothing said goodbye: it is missed once its lease has run out, 10 s in ROS 2.
    with pytest.raises(RosError, match="has gone"):
        node.wait(outcome, TIMEOUT)
    successor = successor or Peer(domain)
    reach(node, picker)
    again = node.wait(picker.send_goal(Pick.Goal("screw")), TIMEOUT)
    assert node.wait(again.result(), TIMEOUT).status is GoalStatus.SUCCEEDED
    assert node.wait(goal.result(), TIMEOUT).status is GoalStatus.UNKNOWN
    assert successor.end() == 0
