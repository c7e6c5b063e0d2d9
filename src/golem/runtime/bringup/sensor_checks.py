"""The check of cameras, LiDAR and hands: each is heard, at its rate, and says something."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, closing
from typing import Any

import numpy as np

from golem.interfaces import public
from golem.interfaces.ros_convert import seconds
from golem.middleware.ros.message import CodecError
from golem.robots.sensors.cameras import CAMERAS
from golem.runtime.bringup.base import DEVICES, StepFinding, Workbench
from golem.types import SIDES

LISTEN = 2.0
"""Time over which each device is listened to [s]."""
FIRST = 20.0
"""How long their first message is waited for [s]."""
ENOUGH = 0.5
"""Share of its rate that has to arrive here: raw images are more than some networks carry."""
SEEN = 0.05
"""Share of the head camera's depth image that has to be measured; a hand camera may look into the air."""


class DeviceEars:
    """What has come from one device.

    Attributes:
        stamps: of its messages [s].
        faults: what is wrong with what they say.
    """

    def __init__(self, bench: Workbench, topic: str, check: Callable[[Any], str]) -> None:
        """Listen to `topic`; `check` returns what is wrong with a message, empty if nothing is."""
        row = public.topic(topic)
        self.stamps: list[float] = []
        self.faults: list[str] = []
        self._check = check
        self._subscription = bench.link.node.subscription(row.name, row.type, self._take, row.qos)

    def close(self) -> None:
        """Stop listening."""
        self._subscription.close()

    def _take(self, message: Any) -> None:
        try:
            wrong = self._check(message)
        except (CodecError, ValueError) as error:
            wrong = str(error)
        self.stamps.append(seconds(message.header.stamp))
        if wrong:
            self.faults.append(wrong)


def check_sensors(bench: Workbench) -> StepFinding:
    """Every device that was not declared absent delivers at its rate, and what it says can be used.

    One is listened to after the other: raw images of all cameras at once are more than some networks carry.
    """
    wanted = [name for name in DEVICES if name not in bench.config.without]
    wrong, figures = list[str](), dict[str, float | str]()
    for name in wanted:
        with ExitStack() as closing_time:
            ears = [closing_time.enter_context(closing(ear)) for ear in _ears(bench, name)]
            passed = _listen(bench, ears)
        for ear in ears:
            wrong += _judge(name, ear, passed, figures)
    figures |= {name: "declared absent" for name in bench.config.without}
    return StepFinding(not wrong, "; ".join(wrong) or f"{len(wanted)} devices deliver", figures)


def _listen(bench: Workbench, ears: list[DeviceEars]) -> float:
    """Wait for the first messages, then listen; return how long, in the robot's time, which devices stamp with [s]."""
    link = bench.link
    clock = link.tell_time if bench.config.dds.robot else None
    link.spin(FIRST, lambda: all(ear.stamps for ear in ears), clock)
    for ear in ears:
        ear.stamps.clear()
        ear.faults.clear()
    link.states.clear()
    link.pass_time(LISTEN, clock)
    return link.states[-1][1].t - link.states[0][1].t if len(link.states) > 1 else LISTEN


def _judge(name: str, ear: DeviceEars, passed: float, figures: dict[str, float | str]) -> list[str]:
    rate = len(set(ear.stamps)) / passed
    figures[f"{name} [Hz]"] = round(rate, 1)
    if not ear.stamps:
        return [f"the {name} is silent: start its driver, or declare it absent (--without)"]
    if rate < ENOUGH * _rate(name):
        return [f"the {name} delivers {rate:.1f} of {_rate(name):g} a second"]
    if len(ear.faults) > 0.5 * len(ear.stamps):
        return [f"the {name}: {ear.faults[-1]}"]
    return []


def _rate(name: str) -> float:
    device = name.removesuffix(" camera")
    return CAMERAS[device].rate if device in CAMERAS else 10.0


def _ears(bench: Workbench, name: str) -> list[DeviceEars]:
    device = name.removesuffix(" camera").removesuffix(" hand")
    if device in CAMERAS:
        color, depth = public.image(device, public.COLOR), public.image(device, public.DEPTH)
        return [
            DeviceEars(bench, color, lambda m: _color(device, m)),
            DeviceEars(bench, depth, lambda m: _depth(device, m)),
        ]
    if device in SIDES:
        return [DeviceEars(bench, public.gripper(device, "state"), lambda _: "")]
    return [DeviceEars(bench, "/livox/pointcloud", lambda m: "" if m.width * m.height else "no points")]


def _size(camera: str, message: Any) -> str:
    info = CAMERAS[camera]
    if (message.width, message.height) != (info.width, info.height):
        return f"{message.width} x {message.height}, not {info.width} x {info.height}"
    return ""


def _color(camera: str, message: Any) -> str:
    pixels = np.frombuffer(message.data, np.uint8)
    return _size(camera, message) or ("" if pixels[::97].std() > 1.0 else "its image is of one colour")


def _depth(camera: str, message: Any) -> str:
    depth = np.frombuffer(message.data, np.uint16)
    measured = np.count_nonzero(depth) / max(1, depth.size)
    blind = camera == "head" and measured < SEEN
    return _size(camera, message) or (f"depth in {100 * measured:.0f} % of its image" if blind else "")
