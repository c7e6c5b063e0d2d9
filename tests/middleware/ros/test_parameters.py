"""A node answers for parameters as ROS 2 asks, and has none."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("rosbags")

from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.msgs import rcl_interfaces as rcl
from golem.middleware.ros.node import SERVICES, RosNode


def ask(service: str, request: Any) -> Any:
    domain = LocalDomain()
    server, client = RosNode(domain.participant(), "twin", "/robot"), RosNode(domain.participant(), "ros2cli")
    kind, _ = SERVICES[service]
    call = client.client(f"/robot/twin/{service}", f"rcl_interfaces/srv/{kind}").call(request)
    server.poll()
    return client.wait(call, 1.0)


def test_there_are_no_parameters() -> None:
    assert ask("list_parameters", rcl.ListParameters_Request()).result.names == []


def test_unknown_parameters_are_not_set_as_in_rclpy() -> None:
    names = ["use_sim_time", "gain"]
    assert [value.type for value in ask("get_parameters", rcl.GetParameters_Request(names)).values] == [0, 0]
    assert list(ask("get_parameter_types", rcl.GetParameterTypes_Request(names)).types) == [0, 0]
    descriptors = ask("describe_parameters", rcl.DescribeParameters_Request(names)).descriptors
    assert [descriptor.name for descriptor in descriptors] == names


@pytest.mark.parametrize("service", ["set_parameters", "set_parameters_atomically"])
def test_setting_one_is_refused_with_a_sentence(service: str) -> None:
    kind, _ = SERVICES[service]
    answer = ask(service, getattr(rcl, f"{kind}_Request")([rcl.Parameter("gain")]))
    results = answer.results if service == "set_parameters" else [answer.result]
    assert [(r.successful, "stack file" in r.reason) for r in results] == [(False, True)]
