"""Makes frames of what is on a bus, at the data set's own rate: in lock-step, from a bag, or from a domain."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from golem.capabilities.policies.observer import Observer, picture_size, resized
from golem.datasets.episode_writer import DatasetWriter
from golem.datasets.schema import Recipe
from golem.errors import ConfigError, unknown_name
from golem.interfaces import images, public, topics
from golem.interfaces import ros_convert as convert
from golem.interfaces.images import Pairing
from golem.interfaces.payloads import Exposure, LegStatus
from golem.middleware.bags.base import BagMessage
from golem.middleware.bus import Bus, News
from golem.middleware.ros import codec
from golem.middleware.ros.message import NANO
from golem.middleware.ros.msgs.sensor_msgs import Image
from golem.middleware.wire.convert import decode_low_command
from golem.robots.sensors.cameras import CAMERAS
from golem.types import SIDES, BaseEstimate, HandState, Imu, LowState, PlanarPose, Twist


def recipe(fps: int, cameras: tuple[str, ...], width: int, depth: bool, masks: tuple[str, ...]) -> Recipe:
    """Return what is recorded of `cameras`, `width` px wide, 0 for as they are. Raises ConfigError: no such one."""
    for name in cameras:
        if name not in CAMERAS:
            raise unknown_name("camera", name, CAMERAS)
        if width and not 16 <= width <= CAMERAS[name].width:
            raise ConfigError(
                f"Pictures of the camera {name} are 16 to {CAMERAS[name].width} pixels wide, not {width}."
            )
    sizes = {name: picture_size(CAMERAS[name], width) for name in cameras}
    return Recipe(fps, sizes, depth and bool(cameras), masks if cameras else ())


class Sampler:
    """Makes the frame of the present moment."""

    def __init__(self, bus: Bus, what: Recipe) -> None:
        """Look at `bus` for what `what` asks for."""
        self._bus, self._recipe, self._observer = bus, what, Observer(bus, tuple(what.cameras))

    def frame(self) -> dict[str, NDArray[Any]] | None:
        """Return a value for each feature; None before everything has spoken once."""
        found = self._observer.look()
        if found is None:
            return None
        now, vectors = found[0], self._observer.vectors
        out = {"observation.state": vectors.state(now), "observation.effort": now.state.tau}
        out |= {"action": vectors.action(now), "command.joints": vectors.targets(now)}
        for name, frame in found[1].items():
            size = self._recipe.cameras[name]
            out[f"observation.images.{name}"] = resized(frame.rgb, size)
            if self._recipe.depth:
                out[f"observation.depth.{name}"] = resized(images.millimetres(frame.depth), size, False)
            if self._recipe.masks:
                out[f"observation.masks.{name}"] = resized(self._labels(name, frame), size, False)
        return out

    def _labels(self, camera: str, frame: Exposure) -> NDArray[np.uint8]:
        """Return which label's mask each pixel is in; what was found in an older picture is where it was then."""
        out, found = np.zeros(frame.depth.shape, np.uint8), self._bus.latest(topics.detections(camera))
        for each in () if found is None else found.objects:
            if each.mask is not None and each.label in self._recipe.masks:
                (height, width), x, y = each.mask.pixels.shape, each.mask.x, each.mask.y
                out[y : y + height, x : x + width][each.mask.pixels] = self._recipe.masks.index(each.label) + 1
        return out


class StackRecorder:
    """Records a stack in lock-step as one episode; a node of its executor.

    Only the last stretch without a gap is recorded of an episode that `stages` limit.
    """

    def __init__(self, writer: DatasetWriter, what: Recipe, bus: Bus, task: str, stages: tuple[str, ...] = ()) -> None:
        """Begin an episode of `writer` in which `task` is done; of a skill's `stages` alone, if given."""
        self.period, self.begun = 1.0 / what.fps, False
        self._writer, self._sampler, self._task, self._stages = writer, Sampler(bus, what), task, stages
        self._news, self._in = News(bus, topics.FEEDBACK), not stages

    def step(self, t: float) -> None:
        """Record a frame."""
        said = self._news.read()
        if said is not None and self._stages:
            within = said.stage in self._stages and not said.data.get("failed")
            self.begun = self.begun and (self._in or not within)
            self._in = within
        frame = self._sampler.frame() if self._in else None
        if frame is None:
            return
        if not self.begun:
            self._writer.begin(self._task)
            self.begun = True
        self._writer.add(frame)


SLACK = NANO // 1000
"""Half a tick [ns]."""


class MessageRecorder:
    """Records public messages, of a bag or a domain, as one episode; a `Sink`.

    A frame is what was there at the end of a tick whose time is a multiple of the period, as in lock-step.
    """

    def __init__(self, writer: DatasetWriter, what: Recipe, task: str) -> None:
        """Begin an episode of `writer` in which `task` is done."""
        self._writer, self._period, self._bus = writer, NANO / what.fps, Bus()
        self._sampler = Sampler(self._bus, what)
        self._next: float | None = None
        writer.begin(task)
        keyed = ("/lowstate", "/base_estimate", *(public.gripper(s, w) for s in SIDES for w in ("state", "command")))
        self._take: dict[str, Callable[[BagMessage], None]] = dict.fromkeys(keyed, self._value)
        self._take |= {"/lowcmd": self._command, "/legs/status": self._legs}
        for name in what.cameras:
            pairing = Pairing(partial(self._picture, name))
            for kind, take in ((public.COLOR, pairing.color), (public.DEPTH, pairing.depth)):
                self._take[public.image(name, kind)] = lambda m, take=take: take(codec.deserialize(m.payload, Image))

    @property
    def topics(self) -> list[str]:
        """Names of the topics that it reads."""
        return list(self._take)

    def write(self, message: BagMessage) -> None:
        while self._next is not None and message.log_time > self._next + SLACK:
            frame = self._sampler.frame()
            if frame is not None:
                self._writer.add(frame)
            self._next += self._period
        if message.topic.name in self._take:
            self._take[message.topic.name](message)
            if self._next is None and self._sampler.frame() is not None:
                self._next = self._period * math.ceil((message.log_time - SLACK) / self._period)

    def close(self) -> None:
        """Do nothing: whoever has the writer finishes the episode."""

    def _value(self, message: BagMessage) -> None:
        row = public.topic(message.topic.name)
        assert row.key is not None
        self._bus.publish(row.key, row.value(message.payload), 0.0)

    def _command(self, message: BagMessage) -> None:
        self._bus.publish(topics.LOW_CMD, decode_low_command(message.payload, 0.0), 0.0)

    def _legs(self, message: BagMessage) -> None:
        said = codec.deserialize(message.payload, codec.message(message.topic.kind))
        twist, rest = replace(convert.to_twist(said.commanded), height=said.commanded_height), PlanarPose(0.0, 0.0, 0.0)
        status = LegStatus(0.0, twist, Twist(), False, "", False, False, rest, np.zeros(2), "")
        self._bus.publish(topics.LEG_STATUS, status, 0.0)

    def _picture(self, camera: str, color: Image, depth: Image) -> None:
        exposure = Exposure(0.0, CAMERAS[camera], images.to_rgb(color), images.to_depth(depth))
        self._bus.publish(topics.exposures(camera), exposure, 0.0)


def write_bag(frames: Mapping[str, NDArray[Any]], fps: int, path: Path) -> int:
    """Write recorded states as a bag, which `robot: {use: replay}` and ROS tools read; returns its messages.

    Args:
        frames: (n, ...) values by feature: `observation.state`, `observation.effort`, and (n, height, width) depths
            with (n, height, width, 3) pictures of cameras, if any.

    Raises:
        OutputError: it exists already, or cannot be written.
    """
    from golem.interfaces.recorded import public_topics
    from golem.middleware.bags.writer import BagWriter

    known, writer = {topic.name: topic for topic in public_topics()}, BagWriter(path)

    def put(name: str, t: float, value: Any) -> None:
        row = public.topic(name)
        assert row.encode is not None
        message, at = row.encode(value), round(t * NANO)
        writer.write(BagMessage(known[name], at, at, message if row.vendor else codec.serialize(message)))

    states, efforts = (np.asarray(frames[f"observation.{name}"], np.float64) for name in ("state", "effort"))
    for k, (x, tau) in enumerate(zip(states, efforts, strict=True)):
        t, T = k / fps, np.eye(4)
        up = x[82:85] / max(float(np.linalg.norm(x[82:85])), 1e-9)
        ahead = np.array([1.0, 0.0, 0.0]) - up[0] * up  # the heading was not recorded
        ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
        T[:3, :3] = ahead, np.cross(up, ahead), up
        quat = np.asarray(Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True))
        put("/lowstate", t, LowState(t, x[:27], x[27:54], tau, Imu(quat, np.zeros(3), 9.81 * up)))
        put("/base_estimate", t, BaseEstimate(t, T, T[:3, :3] @ x[79:82], float(x[78])))
        for i, side in enumerate(SIDES):
            gap, force = max(float(x[72 + i]), 0.0), np.maximum(x[74 + 2 * i : 76 + 2 * i], 0.0)
            put(public.gripper(side, "state"), t, HandState(t, gap, np.full(2, 0.5 * gap), force))
        for name, info in CAMERAS.items():
            if (depth := frames.get(f"observation.depth.{name}")) is not None:
                size, rgb = (info.width, info.height), frames[f"observation.images.{name}"][k]
                metres = resized(depth[k], size, False).astype(np.float32) * 1e-3
                exposure = Exposure(t, info, np.ascontiguousarray(resized(rgb, size)), metres)
                for what in (public.CAMERA_INFO, public.COLOR, public.DEPTH):
                    put(public.image(name, what), t, exposure)
    writer.close()
    return writer.messages
