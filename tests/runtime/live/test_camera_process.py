"""A camera's images on a domain, in simulated time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from golem.interfaces import images, public, ros_convert
from golem.interfaces.payloads import Exposure
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.msgs.rosgraph_msgs import Clock
from golem.middleware.ros.node import RosNode
from golem.robots.sensors.cameras import HEAD
from golem.runtime.live.device_process import CameraProcess, DriverPlace


class Source:
    """A camera that shows what it is given."""

    def __init__(self) -> None:
        self.fault = ""
        self.next: Exposure | None = None

    def step(self) -> Exposure | None:
        found, self.next = self.next, None
        return found


def test_images_bear_the_robots_time_and_faults_are_said() -> None:
    domain = LocalDomain()
    here, there = domain.participant(), domain.participant()
    listener, source, lines, now = RosNode(there, "listener"), Source(), list[str](), 1000.0
    place = DriverPlace(here, RosNode(here, "camera"), lambda: now, lines.append)
    process = CameraProcess(place, "head", source)
    heard: dict[str, list[Any]] = {what: [] for what in (public.COLOR, public.DEPTH, public.CAMERA_INFO)}
    for what, messages in heard.items():
        row = public.topic(public.image("head", what))
        listener.subscription(row.name, row.type, messages.append, row.qos)
    row = public.topic("/clock")
    clock = listener.publisher(row.name, row.type, row.qos)

    rgb = np.full((480, 640, 3), 7, np.uint8)
    depth = np.full((480, 640), 1.5, np.float32)
    source.next = Exposure(999.97, HEAD, rgb, depth)
    process.step()
    listener.poll()
    assert not any(heard.values())  # nobody knows the robot's time yet

    clock.publish(Clock(ros_convert.time(50.0)))
    process.step()
    source.next = Exposure(999.97, HEAD, rgb, depth)
    process.step()
    listener.poll()
    for messages in heard.values():
        assert ros_convert.seconds(messages[0].header.stamp) == pytest.approx(49.97, abs=1e-6)
        assert messages[0].header.frame_id == public.optical_frame("head")
    assert (images.to_rgb(heard[public.COLOR][0]) == rgb).all()
    assert np.allclose(images.to_depth(heard[public.DEPTH][0]), depth)

    source.fault = "device disconnected"
    process.step()
    process.step()
    source.fault = ""
    process.step()
    assert lines == ["head camera: device disconnected", "head camera: it works again."]
