"""Colour and depth of one exposure, which travel as two messages."""

from __future__ import annotations

from collections.abc import Callable

from golem.middleware.ros.msgs.sensor_msgs import Image


class Pairing:
    """Puts the two images of each exposure of one camera together, in whichever order they come."""

    def __init__(self, take: Callable[[Image, Image], None]) -> None:
        """Give colour and depth with equal stamps to `take`."""
        self._take = take
        self._color: Image | None = None
        self._depth: Image | None = None

    def color(self, image: Image) -> None:
        """Take a colour image; one that has not found its depth by then is dropped."""
        self._color = image
        self._complete()

    def depth(self, image: Image) -> None:
        """Take a depth image; one that has not found its colour by then is dropped."""
        self._depth = image
        self._complete()

    def clear(self) -> None:
        """Drop what waits."""
        self._color = self._depth = None

    def _complete(self) -> None:
        color, depth = self._color, self._depth
        if color is not None and depth is not None and color.header.stamp == depth.header.stamp:
            self.clear()
            self._take(color, depth)
