"""What is photographed in another process is what the robot's own camera shows."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time

import numpy as np
import pytest

from golem.interfaces import public, topics
from golem.middleware.bus import Bus
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.node import RosNode
from golem.robots.base import Restorable
from golem.runtime.live import render_worker as live_darkroom
from golem.runtime.live.bridge import outgoing
from golem.runtime.live.render_worker import RenderWorker, expose, image_topics
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.lockstep import build, build_robot
from golem.stack import Stack
from golem.types import TICK


def test_another_robot_shows_the_same_moment() -> None:
    stack = Stack(profile="ideal")
    running, robot = build(stack, seed=3)
    assert isinstance(robot, Restorable)
    running.executor.run(0.3)
    twin = build_robot(stack, 3)
    twin.restore_state(robot.save_state())
    for mine, its in zip(robot.capture("right_hand"), twin.capture("right_hand"), strict=True):
        np.testing.assert_array_equal(mine, its)
    np.testing.assert_array_equal(twin.joints()[0], robot.joints()[0])
    robot.close()
    twin.close()


def test_nothing_is_rendered_unless_somebody_listens() -> None:
    domain = LocalDomain()
    participant = domain.participant()
    endpoints = RoleEndpoints("robot", participant, RosNode(participant, "cameras"), image_topics())
    robot = build_robot(Stack(profile="ideal"), 0)
    bus = Bus()
    streams = outgoing(bus, endpoints)
    topic, save_state = topics.exposures("left_hand"), robot.save_state()
    expose(robot, endpoints, bus, streams, "left_hand", 0.5, save_state)
    assert bus.count(topic) == 0
    listener = RosNode(domain.participant(), "listener")
    row = public.topic(public.image("left_hand", public.COLOR_JPEG))
    subscription = listener.subscription(row.name, row.type, None, row.qos)
    expose(robot, endpoints, bus, streams, "left_hand", 1.5, save_state)
    assert bus.latest(topic) is not None
    message = subscription.latest()
    assert message is not None and (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 500000000)
    assert message.header.frame_id == row.frame and bytes(message.data[:2]) == b"\xff\xd8"
    robot.close()


@pytest.mark.slow
def test_time_waits_for_a_late_image_and_once_for_one_that_does_not_come(
    monkeypatch: pytest.MonkeyPatch, domain: int
) -> None:
    pytest.importorskip("cyclonedds")
    monkeypatch.setattr(live_darkroom, "PATIENCE", 0.5)
    stack = Stack(profile="ideal")
    robot = build_robot(stack, 0)
    assert isinstance(robot, Restorable)
    render_worker = RenderWorker(stack, 0, robot, DdsConfig(domain=domain))
    (process,) = multiprocessing.active_children()
    assert process.pid is not None

    def longest(seconds: float, begin: float) -> float:
        """Return the longest time that a step took [s] in `seconds` of the robot's time."""
        steps = []
        for k in range(round(seconds / TICK)):
            before = time.monotonic()
            render_worker.step(begin + k * TICK)
            steps.append(time.monotonic() - before)
        return max(steps)

    try:
        render_worker.wait(lambda: False)
        render_worker.step(0.0)
        os.kill(process.pid, signal.SIGSTOP)
        # Only once the image is later than the next one of its camera, for as long as patience lasts, and not again.
        assert longest(0.06, 0.0) < 0.4
        assert 0.5 <= longest(0.1, 0.06) < 5.0
        assert longest(0.2, 0.16) < 0.4
        os.kill(process.pid, signal.SIGCONT)
        begin = time.monotonic()
        longest(0.1, 0.36)
        assert time.monotonic() - begin < 30.0
    finally:
        os.kill(process.pid, signal.SIGCONT)
        render_worker.close()
        robot.close()
    assert not process.is_alive()
