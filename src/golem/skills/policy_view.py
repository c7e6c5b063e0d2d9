"""What a policy is shown of the robot: the vectors and pictures of a data set, under their names there."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from golem.capabilities.policies.vectors import Vectors, instant
from golem.interfaces import topics
from golem.skills.context import Context


class PolicyView:
    """Makes observations; open, it has the cameras exposed."""

    def __init__(self, context: Context, cameras: tuple[str, ...], width: int, prompt: str) -> None:
        """Show `cameras`, `width` pixels wide (0: as they are), and the words `prompt`."""
        self._context, self._cameras, self._width, self._prompt = context, cameras, width, prompt
        self._vectors = Vectors()

    def __enter__(self) -> PolicyView:
        """Ask for the cameras."""
        self._before = self._context.bus.latest(topics.CAMERAS_WANTED) or ()
        self._context.publish(topics.CAMERAS_WANTED, tuple(dict.fromkeys((*self._before, *self._cameras))))
        return self

    def __exit__(self, *_: object) -> None:
        """Let the cameras be."""
        self._context.publish(topics.CAMERAS_WANTED, self._before)

    def __call__(self) -> dict[str, Any] | None:
        """Return the observation of this moment; None before everything has spoken once."""
        bus = self._context.bus
        now = instant(bus)
        seen = {name: bus.latest(topics.rgbd_images(name)) for name in self._cameras}
        if now is None or any(frame is None for frame in seen.values()):
            return None
        out: dict[str, Any] = {"observation.state": self._vectors.state(now).astype(np.float32), "prompt": self._prompt}
        for name, frame in seen.items():
            assert frame is not None
            rgb = frame.rgb
            if self._width and self._width != rgb.shape[1]:
                # Even, as recorded pictures are.
                wide = self._width // 2 * 2
                high = round(rgb.shape[0] * wide / rgb.shape[1]) // 2 * 2
                rgb = np.asarray(cv2.resize(rgb, (wide, high), interpolation=cv2.INTER_AREA))
            out[f"observation.images.{name}"] = rgb
        return out
