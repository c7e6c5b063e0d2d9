"""What can be said of the rclpy node without ROS 2; with it, the conformance suite runs on it, too."""

from __future__ import annotations

import importlib.util

import pytest

from golem.errors import MissingSystemLibrary
from golem.middleware.ros import (
    action_client,
    action_server,
    base,
    pubsub,
    rclpy_actions,
    rclpy_node,
    service,
)
from golem.middleware.ros.base import RosNode
from golem.middleware.ros.node import DdsNode
from golem.middleware.ros.rclpy_node import RclpyNode

from .conftest import TRANSPORTS

MODULES = (action_client, action_server, rclpy_actions, rclpy_node, service, pubsub)
CONTRACTS = (
    "ActionClient",
    "ActionServer",
    "Client",
    "ClientGoal",
    "Publisher",
    "ServerGoal",
    "Service",
    "Subscription",
)


@pytest.mark.skipif(importlib.util.find_spec("rclpy") is not None, reason="ROS 2 is here")
def test_without_ros_it_says_where_rclpy_comes_from() -> None:
    with pytest.raises(MissingSystemLibrary, match="part of ROS 2: source .* or use the DDS node"):
        RclpyNode("twin")


@pytest.mark.parametrize("contract", CONTRACTS)
def test_both_have_everything_the_contract_asks_for(contract: str) -> None:
    asked = {name for name in vars(getattr(base, contract)) if not name.startswith("_")}
    for prefix in ("Dds", "Rclpy"):
        (cls,) = {found for m in MODULES if (found := getattr(m, prefix + contract, None)) is not None}
        assert asked and asked <= set(dir(cls))


def test_the_conformance_suite_runs_on_it_where_ros_is() -> None:
    if "rclpy" not in TRANSPORTS:
        pytest.skip("needs ROS 2: rclpy cannot be imported, the rclpy node is untested")


def nodes(participant: object) -> list[RosNode]:
    """Never run: here the type checker compares the nodes' signatures with the contract's."""
    return [DdsNode(participant, "a"), RclpyNode("b")]  # type: ignore[arg-type]
