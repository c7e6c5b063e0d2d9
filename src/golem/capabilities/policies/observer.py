"""What is on a bus at one moment, under the names of a data set: for who records, and for policies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.policies.vectors import Instant, Vectors, instant
from golem.interfaces import topics
from golem.middleware.bus import Bus, Topic
from golem.types import CameraInfo


def picture_size(info: CameraInfo, width: int) -> tuple[int, int]:
    """Return width and height of a camera's picture that is `width` wide (0: as it is): even, as encoders ask [px]."""
    wide = (width or info.width) // 2 * 2
    return wide, round(info.height * wide / info.width) // 2 * 2


def resized(picture: NDArray[Any], size: tuple[int, int], smooth: bool = True) -> NDArray[Any]:
    """Return a picture with `size` (width, height); of depths and labels none is made up."""
    if picture.shape[1::-1] == size:
        return picture
    # OpenCV's INTER_NEAREST takes the upper left of the pixels that become one: depth would be beside its colour.
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA if smooth else cv2.INTER_NEAREST_EXACT))


class Observer:
    """Looks at a bus, and has the cameras exposed."""

    def __init__(
        self, bus: Bus, cameras: Sequence[str], width: int = 0, stream: Callable[[str], Topic[Any]] = topics.exposures
    ) -> None:
        """Look at `bus` and its `cameras`, pictures `width` wide; `topics.rgbd_images` has them once they arrived."""
        self.vectors, self._bus, self._cameras, self._width, self._stream = Vectors(), bus, cameras, width, stream
        wanted = bus.latest(topics.CAMERAS_WANTED) or ()
        if not set(cameras) <= set(wanted):
            bus.publish(topics.CAMERAS_WANTED, tuple(dict.fromkeys((*wanted, *cameras))), 0.0)

    def look(self) -> tuple[Instant, dict[str, Any]] | None:
        """Return what is newest: vectors' sources, and a frame of each camera; None before all have spoken."""
        now = instant(self._bus)
        seen = {name: self._bus.latest(self._stream(name)) for name in self._cameras}
        return None if now is None or any(frame is None for frame in seen.values()) else (now, seen)

    def observation(self) -> dict[str, Any] | None:
        """Return state and pictures by their names; None before all have spoken."""
        found = self.look()
        if found is None:
            return None
        out = {"observation.state": self.vectors.state(found[0]).astype(np.float32)}
        for name, frame in found[1].items():
            out[f"observation.images.{name}"] = resized(frame.rgb, picture_size(frame.info, self._width))
        return out
