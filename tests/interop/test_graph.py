"""Who finds whom, and what each sees of the other."""

from __future__ import annotations

from collections.abc import Callable

import pytest

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from tests.interop.peers import Ros, joined, until
from tests.interop.rows import cdr

from golem.middleware.ros import codec
from golem.middleware.ros.msgs.rcl_interfaces import (
    ListParameters_Request,
    ListParameters_Response,
    Parameter,
    SetParameters_Request,
    SetParameters_Response,
)
from golem.middleware.ros.msgs.std_srvs import Trigger_Request, Trigger_Response
from golem.middleware.ros.node import RosNode

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

TRIGGER = "std_srvs/srv/Trigger"
LIST, SET = "rcl_interfaces/srv/ListParameters", "rcl_interfaces/srv/SetParameters"


@pytest.mark.parametrize("first", ["ros", "golem"])
def test_each_finds_the_other_whoever_came_first(join: Callable[[], Ros], domain: int, first: str) -> None:
    ros = join() if first == "ros" else None
    with joined(domain) as node:
        node.service("/ready", TRIGGER, lambda _: Trigger_Response(True, "yes"))
        ros = ros or join()
        ask = {"name": "/ready", "type": TRIGGER, "request": cdr(Trigger_Request())}
        answer = ros.do("call", node, **ask)
        assert [codec.deserialize(bytes.fromhex(a), Trigger_Response) for a in answer["answers"]] == [
            Trigger_Response(True, "yes")
        ]


def test_the_graph_shows_our_node_and_what_it_offers(node: RosNode, ros: Ros) -> None:
    node.publisher("/chat", "std_msgs/msg/String")
    node.service("/ready", TRIGGER, lambda _: Trigger_Response())
    node.action_server("/skill/pick", "golem_interfaces/action/Pick", None)  # type: ignore[arg-type]

    def seen() -> bool:
        graph = ros.do("graph", node)
        return (
            "/golem" in graph["nodes"]
            and graph["topics"].get("/chat") == ["std_msgs/msg/String"]
            and graph["services"].get("/ready") == [TRIGGER]
            and "/skill/pick/_action/send_goal" in graph["services"]
        )

    assert until(node, seen), ros.do("graph", node)


def test_our_node_answers_for_its_parameters(node: RosNode, ros: Ros) -> None:
    def call(what: str, type: str, request: object, response: type) -> object:
        answers = ros.do("call", node, name=f"/golem/{what}", type=type, request=cdr(request))["answers"]
        return codec.deserialize(bytes.fromhex(answers[0]), response)

    listed = call("list_parameters", LIST, ListParameters_Request(), ListParameters_Response)
    assert listed == ListParameters_Response()
    asked = SetParameters_Request([Parameter("use_sim_time")])
    refused = call("set_parameters", SET, asked, SetParameters_Response)
    assert isinstance(refused, SetParameters_Response)
    (result,) = refused.results
    assert not result.successful and result.reason
