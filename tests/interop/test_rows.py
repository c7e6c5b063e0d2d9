"""Every row of the table of interfaces goes to a real ROS 2 and comes from it, unharmed."""

from __future__ import annotations

import pytest

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from tests.interop.peers import Ros
from tests.interop.rows import ALIEN, from_us, to_us, unique

from golem.interfaces.public import TopicRow
from golem.middleware.ros.node import RosNode

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]


def test_what_ros_gets_of_us(node: RosNode, ros: Ros) -> None:
    verdicts = {row.name: from_us(row, node, ros) for row in unique()}
    assert {name: verdict for name, verdict in verdicts.items() if verdict.result != "passed"} == {}


def test_what_we_get_of_ros(node: RosNode, ros: Ros) -> None:
    verdicts = {row.name: to_us(row, node, ros) for row in unique()}
    bad = {name: verdict for name, verdict in verdicts.items() if verdict.result != "passed"}
    if ros.setup.vendor == "fastdds":
        assert {name: verdict.why for name, verdict in bad.items()} == {
            row.name: ALIEN for row in unique() if not isinstance(row, TopicRow)
        }
    else:
        assert bad == {}
