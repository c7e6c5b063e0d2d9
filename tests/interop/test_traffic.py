"""Bursts of calls, and images as fast as the cameras bring them."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from tests.interop.peers import Ros, until
from tests.interop.rows import cdr

from golem.middleware.dds.base import SENSOR
from golem.middleware.ros.future import Future
from golem.middleware.ros.msgs.sensor_msgs import Image
from golem.middleware.ros.msgs.std_srvs import SetBool_Request, SetBool_Response
from golem.middleware.ros.node import RosNode

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

SET_BOOL = "std_srvs/srv/SetBool"
ROS_KEEPS = 10
"""Depth of ROS's service profile: of more at once, a server or client of ROS may lose what it has not read yet."""
RATE = 15
"""Of a camera [Hz]."""
PATIENT_IMAGES = 200


def test_a_burst_of_calls_is_answered_as_far_as_ros_keeps_it(node: RosNode, ros: Ros) -> None:
    node.service("/set", SET_BOOL, lambda request: SetBool_Response(request.data, "done"))
    call = {"name": "/set", "type": SET_BOOL, "request": cdr(SetBool_Request(True))}
    for count in (1, ROS_KEEPS):
        assert len(ros.do("call", node, count=count, **call)["answers"]) == count
    assert len(ros.do("call", node, count=200, timeout=3.0, **call)["answers"]) >= ROS_KEEPS
    assert len(ros.do("call", node, **call)["answers"]) == 1


def test_a_burst_of_ours_loses_what_ros_does_not_keep(node: RosNode, ros: Ros) -> None:
    if ros.setup.vendor == "fastdds":
        pytest.skip("we do not call servers of Fast DDS")
    ros.do("serve", node, name="/set", type=SET_BOOL, response=cdr(SetBool_Response(True, "done")))
    client = node.client("/set", SET_BOOL)
    assert until(node, client.ready)
    calls: list[Future[SetBool_Response]] = [client.call(SetBool_Request(True)) for _ in range(50)]
    until(node, lambda: all(call.done for call in calls), 3.0)
    assert sum(call.done for call in calls) >= ROS_KEEPS
    assert node.wait(client.call(SetBool_Request(True)), 10.0).success


def test_images_arrive_whole(node: RosNode, ros: Ros) -> None:
    """Best effort and a burst of 1 MB: how many arrive is the machine's, that what arrives is right is ours."""
    publisher = node.publisher("/image", "sensor_msgs/msg/Image", SENSOR)
    ros.do("listen", node, name="/image", type="sensor_msgs/msg/Image", keep=1,
           reliable=False, transient_local=False, depth=5)  # fmt: skip
    assert until(node, publisher.matched)
    pixels = np.random.default_rng(0).integers(0, 256, 921600, np.uint8)
    image = Image(height=480, width=640, encoding="rgb8", step=1920, data=pixels)
    for _ in range(PATIENT_IMAGES):
        publisher.publish(image)
        until(node, lambda: False, 1 / RATE)
        came = ros.do("came", node, name="/image")
        if came["count"] >= 10:
            break
    assert came["count"] >= 10 and came["first"] == [cdr(image)]
