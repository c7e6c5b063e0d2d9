"""What is photographed in another process is what the robot's own camera shows."""

from __future__ import annotations

import numpy as np

from golem.middleware import public, topics
from golem.middleware.bus import Bus
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.node import DdsNode
from golem.middleware.topics import Exposure
from golem.robots.base import Recallable
from golem.runtime.assembly import build, build_robot
from golem.runtime.live.darkroom import expose, image_topics
from golem.runtime.live.robot_out import CameraOut
from golem.runtime.live.surface import Surface
from golem.stack import Stack


def test_another_robot_shows_the_same_moment() -> None:
    stack = Stack(profile="ideal")
    running, robot = build(stack, seed=3)
    assert isinstance(robot, Recallable)
    running.executor.run(0.3)
    twin = build_robot(stack, 3)
    twin.recall(robot.snapshot())
    for mine, its in zip(robot.capture("right_hand"), twin.capture("right_hand"), strict=True):
        np.testing.assert_array_equal(mine, its)
    np.testing.assert_array_equal(twin.joints()[0], robot.joints()[0])
    robot.close()
    twin.close()


def test_nothing_is_rendered_unless_somebody_listens() -> None:
    domain = LocalDomain()
    participant = domain.participant()
    surface = Surface("robot", participant, DdsNode(participant, "cameras"), image_topics())
    robot = build_robot(Stack(profile="ideal"), 0)
    bus = Bus()
    cameras = {"left_hand": CameraOut(bus, surface, "left_hand")}
    topic, snapshot = topics.exposures("left_hand"), robot.snapshot()
    expose(robot, cameras, bus, "left_hand", 0.5, snapshot)
    assert bus.count(topic) == 0
    listener = DdsNode(domain.participant(), "listener")
    row = public.topic(public.image("left_hand", public.COLOR_JPEG))
    subscription = listener.subscription(row.name, row.type, None, row.qos)
    expose(robot, cameras, bus, "left_hand", 1.5, snapshot)
    assert bus.latest(topic, Exposure) is not None
    message = subscription.latest()
    assert message is not None and (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 500000000)
    assert message.header.frame_id == row.frame and bytes(message.data[:2]) == b"\xff\xd8"
    robot.close()
