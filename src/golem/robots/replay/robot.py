"""A robot that does again what one did while it was recorded, whatever it is told."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from golem.errors import RobotGone
from golem.interfaces import images, public
from golem.interfaces.images import Lens, Pairing, to_lens
from golem.middleware.bags.base import BagError, BagMessage
from golem.middleware.bags.reader import Bag
from golem.middleware.ros import codec
from golem.middleware.ros.goals import from_time
from golem.middleware.ros.message import NANO, CodecError
from golem.middleware.ros.msgs.sensor_msgs import CameraInfo as InfoMessage
from golem.middleware.ros.msgs.sensor_msgs import Image
from golem.middleware.ros.msgs.tf2_msgs import TFMessage
from golem.middleware.wire.struct_layout import WireError
from golem.robots.base import STAMP_TOLERANCE
from golem.robots.sensors.calibration import calibrations
from golem.robots.sensors.cameras import CAMERAS
from golem.types import SIDES, Array, HandCommand, HandState, Imu, LowCommand, LowState, Side

T = TypeVar("T")
STATE, STATIC = "/lowstate", "/tf_static"
AHEAD = 0.5
"""How far the log is read ahead [s] [own]: an image is recorded when it arrives, up to so long after its exposure."""
RESTART = 1.0
"""Step back in time that means another robot, or one that was restarted [s] [own]."""

Picture = tuple[NDArray[np.uint8], NDArray[np.float32]]
"""Colour (height, width, 3) and depth (height, width) [m] of one exposure."""


class Track(Generic[T]):
    """One measured quantity over time."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, T]] = deque()

    def add(self, t: float, value: T) -> None:
        """Append what was measured at `t` [s]."""
        self._samples.append((t, value))

    def at(self, t: float) -> T | None:
        """Return the newest of up to `t` [s], and forget those before it; None where there is none yet."""
        samples = self._samples
        while len(samples) > 1 and samples[1][0] <= t + STAMP_TOLERANCE:
            samples.popleft()
        return samples[0][1] if samples and samples[0][0] <= t + STAMP_TOLERANCE else None


class Log:
    """A bag that is read as time passes; times are seconds since its first state.

    States and hands have the time at which they were recorded, images that of their exposure. Both are the domain's.

    Attributes:
        calibration: per camera the (4, 4) pose of its optical frame, as the recorded robot's calibration claims it, in
            that of the nominal model.
        end: time of the last state; None until it has been read.
    """

    def __init__(self, path: Path) -> None:
        """Open the bag at `path`. Raises BagError: it is absent, damaged, or holds no state of a robot."""
        self._bag = bag = Bag(path)
        if STATE not in bag.topics:
            raise BagError(
                f"The bag {path} has no messages on {STATE}, so it cannot stand in for a robot; it has "
                f"{', '.join(sorted(bag.topics)) or 'none at all'}."
            )
        self.states: Track[LowState] = Track()
        self.hands: dict[Side, Track[HandState]] = {side: Track() for side in SIDES}
        self.end: float | None = None
        self._lenses, self.calibration = _cameras(bag)
        self.cameras = {name: lens.camera for name, lens in self._lenses.items()}
        self.pictures: dict[str, Track[Picture]] = {name: Track() for name in self.cameras}
        self._take: dict[str, Callable[[BagMessage], None]] = {STATE: self._state}
        for side in SIDES:
            self._take[public.gripper(side, "state")] = partial(self._hand, side)
        for name in self.cameras:
            pairing = Pairing(partial(self._picture, name))
            self._take[public.image(name, public.COLOR)] = partial(_image, pairing.color)
            self._take[public.image(name, public.DEPTH)] = partial(_image, pairing.depth)
        first = next(bag.messages([STATE]), None)
        if first is None:
            raise BagError(f"Nothing was published on {STATE} in the bag {path}: it cannot stand in for a robot.")
        self._origin = first.log_time
        self._messages = bag.messages(self._take)
        self._read = self._newest = -math.inf
        self.read(0.0)

    def read(self, t: float) -> None:
        """Read on until everything measured up to `t` [s] is there, and forget what it replaces; errors as above."""
        while self.end is None and self._read < t + AHEAD:
            message = next(self._messages, None)
            at = -math.inf if message is None else self._time(message.log_time)
            if message is None or at < self._read - RESTART:
                self.end = self._newest
            else:
                self._read = at
                try:
                    self._take[message.topic.name](message)
                except (CodecError, WireError) as error:
                    where = f"{self._bag.path}, {message.topic.name} {at:.3f} s after its first state"
                    raise BagError(f"{where}: {error}") from error
        for track in (self.states, *self.hands.values(), *self.pictures.values()):
            track.at(t)

    def _time(self, time: int) -> float:
        return (time - self._origin) / NANO

    def _state(self, message: BagMessage) -> None:
        self._newest = self._time(message.log_time)
        self.states.add(self._newest, public.topic(STATE).value(message.payload))

    def _hand(self, side: Side, message: BagMessage) -> None:
        state: HandState = public.topic(message.topic.name).value(message.payload)
        self.hands[side].add(self._time(message.log_time), state)

    def _picture(self, camera: str, color: Image, depth: Image) -> None:
        t = self._time(from_time(color.header.stamp))
        picture = self._lenses[camera].straighten(images.to_rgb(color), images.to_depth(depth))
        self.pictures[camera].add(t, picture)


def _image(take: Callable[[Image], None], message: BagMessage) -> None:
    take(codec.deserialize(message.payload, Image))


def _cameras(bag: Bag) -> tuple[dict[str, Lens], dict[str, Array]]:
    """Return the recorded cameras and their calibration; what ROS does not say of a camera, its table does."""
    infos = {public.image(name, public.CAMERA_INFO): name for name in CAMERAS}
    recorded = [topic for topic in infos if topic in bag.topics]
    found: dict[str, Lens] = {}
    claimed: dict[str, Array] = {}
    for message in bag.messages((STATIC,)):
        claimed |= calibrations(codec.deserialize(message.payload, TFMessage))
    for message in bag.messages(recorded):
        nominal = CAMERAS[infos[message.topic.name]]
        info = codec.deserialize(message.payload, InfoMessage)
        found[nominal.name] = to_lens(info, nominal.name, nominal.near, nominal.far, nominal.rate)
        if len(found) == len(recorded):
            break
    return found, {name: claimed.get(name, np.eye(4)) for name in found}


@dataclass(frozen=True)
class ReplayRobotConfig:
    """Options of the recorded robot.

    Attributes:
        file: folder of a bag, or an MCAP file, with at least /lowstate.
    """

    file: Path


class ReplayRobot:
    """The robot in a bag; see `golem.robots.base.Robot`. It begins at time 0, and commands move nothing."""

    unmoved = "it is a recording"

    def __init__(self, config: ReplayRobotConfig) -> None:
        """Open the bag. Raises BagError: absent, damaged or without state; MissingExtra: `record` is not there."""
        self._file = config.file
        self._log = Log(config.file)
        self._t = 0.0
        self.cameras, self.calibration = self._log.cameras, self._log.calibration

    def advance(self, command: LowCommand, hands: dict[Side, HandCommand], dt: float) -> None:
        """Let time pass; the commands go nowhere. Raises RobotGone: the recording is over."""
        self._t += dt
        self._log.read(self._t)
        if self._log.end is not None and self._t > self._log.end + dt / 2.0:
            raise RobotGone(f"The recording {self._file} ends after {self._log.end:.2f} s.")

    def joints(self) -> tuple[Array, Array, Array]:
        state = self._state()
        return state.q, state.dq, state.tau

    def imu(self) -> Imu:
        return self._state().imu

    def hand(self, side: Side, t: float) -> HandState:
        """Return what one hand reported, stamped `t` [s]; one that was not recorded is closed and feels nothing."""
        state = self._log.hands[side].at(self._t)
        return HandState(t, 0.0, np.zeros(2), np.zeros(2)) if state is None else replace(state, t=t)

    def capture(self, camera: str) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return the last recorded exposure of `camera`; before the first it is black, and nothing is near."""
        picture = self._log.pictures[camera].at(self._t)
        if picture is not None:
            return picture
        info = self.cameras[camera]
        return np.zeros((info.height, info.width, 3), np.uint8), np.zeros((info.height, info.width), np.float32)

    def close(self) -> None:
        """Do nothing: the bag is closed with the robot."""

    def _state(self) -> LowState:
        state = self._log.states.at(self._t)
        assert state is not None  # the log begins with one
        return state
