"""Makes frames of what is on a bus, at the data set's own rate: in lock-step, from a bag, or from a domain."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.policies.vectors import Instant, Vectors, instant
from golem.datasets.episode_writer import DatasetWriter
from golem.datasets.schema import Recipe
from golem.errors import ConfigError, unknown_name
from golem.interfaces import images, public, topics
from golem.interfaces import ros_convert as convert
from golem.interfaces.images import Pairing
from golem.interfaces.payloads import Detections, Exposure, LegStatus
from golem.middleware.bags.base import BagMessage
from golem.middleware.bus import Bus, News
from golem.middleware.ros import codec
from golem.middleware.ros.message import NANO
from golem.middleware.ros.msgs.sensor_msgs import Image
from golem.middleware.wire.convert import decode_low_command
from golem.robots.sensors.cameras import CAMERAS
from golem.types import SIDES, CameraInfo, PlanarPose, Twist


def recipe(fps: int, cameras: tuple[str, ...], width: int, depth: bool, masks: tuple[str, ...]) -> Recipe:
    """Return what is recorded of the cameras called `cameras`, `width` pixels wide; 0 is as wide as they are.

    Raises:
        ConfigError: there is no such camera or rate.
    """
    chosen: dict[str, CameraInfo] = {}
    for name in cameras:
        if name not in CAMERAS:
            raise unknown_name("camera", name, CAMERAS)
        info = CAMERAS[name]
        if width and not 16 <= width <= info.width:
            raise ConfigError(f"Pictures of the camera {name} are 16 to {info.width} pixels wide, not {width}.")
        # Even, as the encoder's colour planes ask.
        wide = (width or info.width) // 2 * 2
        chosen[name] = replace(info, width=wide, height=round(info.height * wide / info.width) // 2 * 2)
    return Recipe(fps, chosen, depth and bool(chosen), masks if chosen else ())


SLACK = NANO // 1000
"""Half a tick [ns]."""


class Sampler:
    """Makes the frame of the present moment."""

    def __init__(self, bus: Bus, what: Recipe) -> None:
        """Look at `bus` for what `what` asks for, and ask for the cameras."""
        self._bus, self._recipe, self._vectors = bus, what, Vectors()
        wanted = bus.latest(topics.CAMERAS_WANTED) or ()
        if what.cameras:
            bus.publish(topics.CAMERAS_WANTED, tuple(dict.fromkeys((*wanted, *what.cameras))), 0.0)

    def frame(self) -> dict[str, NDArray[Any]] | None:
        """Return a value for each feature; None before everything has spoken once."""
        now = instant(self._bus)
        seen = {name: self._bus.latest(topics.exposures(name)) for name in self._recipe.cameras}
        if now is None or any(exposure is None for exposure in seen.values()):
            return None
        out = vectors_of(self._vectors, now)
        for name, exposure in seen.items():
            assert exposure is not None
            info = self._recipe.cameras[name]
            size = info.width, info.height
            out[f"observation.images.{name}"] = resized(exposure.rgb, size)
            if self._recipe.depth:
                out[f"observation.depth.{name}"] = resized(images.millimetres(exposure.depth), size, False)
            if self._recipe.masks:
                found = self._bus.latest(topics.detections(name))
                labels = _labels(found, exposure, self._recipe.masks)
                out[f"observation.masks.{name}"] = resized(labels, size, False)
        return out


def vectors_of(vectors: Vectors, now: Instant) -> dict[str, NDArray[Any]]:
    """Return the vectors of a moment by feature."""
    return {
        "observation.state": vectors.state(now),
        "observation.effort": now.state.tau,
        "action": vectors.action(now),
        "command.joints": vectors.targets(now),
    }


def resized(picture: NDArray[Any], size: tuple[int, int], smooth: bool = True) -> NDArray[Any]:
    """Return a picture with `size` (width, height); of depths and labels none is made up."""
    if picture.shape[1::-1] == size:
        return picture
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA if smooth else cv2.INTER_NEAREST))


def _labels(found: Detections | None, exposure: Exposure, labels: tuple[str, ...]) -> NDArray[np.uint8]:
    """Return which label's mask each pixel is in; what was found in an older picture is where it was then."""
    out = np.zeros(exposure.depth.shape, np.uint8)
    for each in () if found is None else found.objects:
        if each.mask is not None and each.label in labels:
            mask = each.mask
            height, width = mask.pixels.shape
            out[mask.y : mask.y + height, mask.x : mask.x + width][mask.pixels] = labels.index(each.label) + 1
    return out


class StackRecorder:
    """Records a stack in lock-step as one episode, tick by tick; a node of its executor.

    Only the last stretch without a gap is recorded of an episode that `stages` limit.
    """

    def __init__(self, writer: DatasetWriter, what: Recipe, bus: Bus, task: str, stages: tuple[str, ...] = ()) -> None:
        """Begin an episode of `writer` in which `task` is done; of a skill's `stages` alone, if given."""
        self.period = 1.0 / what.fps
        self._writer, self._sampler, self._task, self._stages = writer, Sampler(bus, what), task, stages
        self._news, self._in = News(bus, topics.FEEDBACK), not stages
        self._begun = False

    def step(self, t: float) -> None:
        """Record a frame."""
        said = self._news.read()
        if said is not None and self._stages:
            within = said.stage in self._stages and not said.data.get("failed")
            self._begun = self._begun and (self._in or not within)
            self._in = within
        frame = self._sampler.frame() if self._in else None
        if frame is None:
            return
        if not self._begun:
            self._writer.begin(self._task)
            self._begun = True
        self._writer.add(frame)

    @property
    def frames(self) -> bool:
        """Whether there are any."""
        return self._begun


class MessageRecorder:
    """Records public messages, of a bag or a domain, as one episode; a `Sink`.

    A frame is what was there at the end of a tick whose time is a multiple of the period, as in lock-step.
    """

    def __init__(self, writer: DatasetWriter, what: Recipe, task: str) -> None:
        """Begin an episode of `writer` in which `task` is done."""
        self._writer, self._period = writer, NANO / what.fps
        self._bus = Bus()
        self._sampler = Sampler(self._bus, what)
        self._next: float | None = None
        writer.begin(task)
        keyed = ("/lowstate", "/base_estimate", *(public.gripper(s, w) for s in SIDES for w in ("state", "command")))
        self._take: dict[str, Callable[[BagMessage], None]] = {name: self._value for name in keyed}
        self._take |= {"/lowcmd": self._command, "/legs/status": self._legs}
        for name in what.cameras:
            pairing = Pairing(partial(self._picture, name))
            self._take[public.image(name, public.COLOR)] = partial(_image, pairing.color)
            self._take[public.image(name, public.DEPTH)] = partial(_image, pairing.depth)

    @property
    def topics(self) -> list[str]:
        """Names of the topics that it reads."""
        return list(self._take)

    def write(self, message: BagMessage) -> None:
        """Take one message; see `Sink`."""
        while self._next is not None and message.log_time > self._next + SLACK:
            frame = self._sampler.frame()
            if frame is not None:
                self._writer.add(frame)
            self._next += self._period
        take = self._take.get(message.topic.name)
        if take is not None:
            take(message)
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
        twist = replace(convert.to_twist(said.commanded), height=said.commanded_height)
        rest, phase = PlanarPose(0.0, 0.0, 0.0), np.zeros(2)
        self._bus.publish(
            topics.LEG_STATUS, LegStatus(0.0, twist, Twist(), False, "", False, False, rest, phase, ""), 0.0
        )

    def _picture(self, camera: str, color: Image, depth: Image) -> None:
        exposure = Exposure(0.0, CAMERAS[camera], images.to_rgb(color), images.to_depth(depth))
        self._bus.publish(topics.exposures(camera), exposure, 0.0)


def _image(take: Callable[[Image], None], message: BagMessage) -> None:
    take(codec.deserialize(message.payload, Image))


def write_bag(frames: Mapping[str, NDArray[Any]], fps: int, path: Path) -> int:
    """Write recorded states as a bag, which `robot: {use: replay}` and ROS tools read; returns its messages.

    Args:
        frames: (n, ...) values by feature: `observation.state`, `observation.effort`, and (n, height, width) depths
            with (n, height, width, 3) pictures of cameras, if any.
        fps: frames per second.
        path: folder of the bag.

    Raises:
        OutputError: it exists already, or cannot be written.
    """
    from golem.interfaces.recorded import public_topics
    from golem.middleware.bags.writer import BagWriter
    from golem.types import BaseEstimate, HandState, Imu, LowState

    topics_by_name = {topic.name: topic for topic in public_topics()}
    writer = BagWriter(path)

    def put(name: str, t: float, value: Any) -> None:
        row = public.topic(name)
        assert row.encode is not None
        message = row.encode(value)
        payload = message if row.vendor else codec.serialize(message)
        writer.write(BagMessage(topics_by_name[name], round(t * NANO), round(t * NANO), payload))

    for k, (x, tau) in enumerate(zip(frames["observation.state"], frames["observation.effort"], strict=True)):
        t, x = k / fps, np.asarray(x, np.float64)
        q, dq, gaps, forces = x[:27], x[27:54], x[72:74], x[74:78].reshape(2, 2)
        up = x[82:85] / max(float(np.linalg.norm(x[82:85])), 1e-9)
        R = _upright(up)
        put(
            "/lowstate", t, LowState(t, q, dq, np.asarray(tau, np.float64), Imu(_quaternion(R), np.zeros(3), 9.81 * up))
        )
        T = np.eye(4)
        T[:3, :3] = R
        put("/base_estimate", t, BaseEstimate(t, T, R @ x[79:82], float(x[78])))
        for side, gap, force in zip(SIDES, gaps, forces, strict=True):
            gap = max(float(gap), 0.0)
            put(public.gripper(side, "state"), t, HandState(t, gap, np.full(2, 0.5 * gap), np.maximum(force, 0.0)))
        for name, info in CAMERAS.items():
            if (depth := frames.get(f"observation.depth.{name}")) is not None:
                rgb, size = frames[f"observation.images.{name}"][k], (info.width, info.height)
                metres = resized(depth[k], size, False).astype(np.float32) * 1e-3
                exposure = Exposure(t, info, np.ascontiguousarray(resized(rgb, size)), metres)
                for what in (public.CAMERA_INFO, public.COLOR, public.DEPTH):
                    put(public.image(name, what), t, exposure)
    writer.close()
    return writer.messages


def _upright(up: NDArray[Any]) -> NDArray[Any]:
    """Return the rotation (3, 3) into a level frame of a base in which `up` (3,) is vertical; its heading is lost."""
    x = np.array([1.0, 0.0, 0.0]) - up[0] * up
    x /= max(float(np.linalg.norm(x)), 1e-9)
    return np.array([x, np.cross(up, x), up])


def _quaternion(R: NDArray[Any]) -> NDArray[Any]:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_quat(scalar_first=True))
