"""Driver of a RealSense camera (D435i, D405): colour and depth aligned to it, as the twin's cameras deliver them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.errors import GolemError, MissingExtra, MissingSystemLibrary
from golem.hardware.drivers.device_clock import DeviceClock
from golem.interfaces.payloads import Exposure
from golem.types import CameraInfo

RECORDINGS = (".bag", ".db3")
"""How the names of the library's recordings end: of older and of newer releases."""
WAIT = 50
"""Longest wait for frames in one step [ms]."""
SILENT = 1.0
"""Time without frames after which the camera is started again [s]."""
RESTART = 1.0
"""Time between two attempts to start a camera that is gone [s]."""
MAX_LATENCY = 1.0
"""Age up to which a stamp in this machine's wall clock is believed [s]; a recording's is older."""
BACK = 0.1
"""How far back a stamp must be to mean that the camera's clock was started again [s]."""

Frames = Callable[[], Any]
"""Returns the next set of frames of pyrealsense2, or None; raises RuntimeError where the camera is gone."""


class CameraError(GolemError):
    """A camera that cannot be started."""


def library() -> Any:
    """Return pyrealsense2. Raises MissingExtra: it is absent; MissingSystemLibrary: its USB library is."""
    try:
        import pyrealsense2
    except ModuleNotFoundError as error:
        raise MissingExtra("pyrealsense2", "realsense") from error
    except ImportError as error:
        raise MissingSystemLibrary(
            f"pyrealsense2 cannot be loaded ({error}); on Debian: apt-get install libusb-1.0-0."
        ) from error
    return pyrealsense2


def device_frames(wanted: CameraInfo, serial: str) -> Frames:
    """Start the camera with a serial number, or play a recording (`RECORDINGS`).

    Args:
        wanted: image size [px] and rate [Hz].
        serial: number of the device, or path of a recording.

    Raises:
        CameraError: it cannot be started so.
        MissingExtra, MissingSystemLibrary: see `library`.
    """
    rs = library()
    pipeline, config = rs.pipeline(), rs.config()
    if serial.endswith(RECORDINGS):
        config.enable_device_from_file(serial, repeat_playback=False)
    else:
        size = (wanted.width, wanted.height)
        config.enable_device(serial)
        config.enable_stream(rs.stream.depth, *size, rs.format.z16, round(wanted.rate))
        config.enable_stream(rs.stream.color, *size, rs.format.rgb8, round(wanted.rate))
    if not config.can_resolve(rs.pipeline_wrapper(pipeline)):
        raise CameraError(
            f"No camera or recording '{serial}' with {wanted.width} x {wanted.height} pixels at "
            f"{wanted.rate:g} Hz is here."
        )
    try:
        pipeline.start(config)
    except RuntimeError as error:
        raise CameraError(f"The camera '{serial}' cannot be started: {error}.") from error

    def frames() -> Any:
        arrived, found = pipeline.try_wait_for_frames(WAIT)
        return found if arrived else None

    return frames


class RealSense:
    """One camera. A step waits for frames for up to 50 ms: it needs a process or a thread of its own.

    Attributes:
        fault: why there are no frames; empty while they come.
        dropped: sets of frames in which one was missing.
    """

    def __init__(
        self,
        camera: CameraInfo,
        start: Callable[[], Frames],
        now: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        """Start it.

        Args:
            camera: name, depth range and rate; what else it says is replaced by what the device says.
            now: clock of the stamps [s].
            wall: this machine's wall clock [s], in which newer cameras stamp.

        Raises:
            CameraError: it cannot be started.
        """
        self._rs = library()
        self._camera, self._start, self._now, self._wall = camera, start, now, wall
        self._align = self._rs.align(self._rs.stream.color)
        self._maps: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
        self._profile: Any = None
        self._clock = DeviceClock()
        self._newest = self._retry = float("-inf")
        self._heard = now()
        self._frames: Frames | None = start()
        self.fault, self.dropped = "", 0

    def step(self) -> Exposure | None:
        """Return what the camera saw; None if there is nothing new."""
        t = self._now()
        if self._frames is None and t < self._retry:
            return None
        try:
            if self._frames is None:
                self._frames, self._heard = self._start(), t
            frames = self._frames()
        except (RuntimeError, CameraError) as error:
            self._frames, self.fault, self._retry = None, str(error), t + RESTART
            return None
        t = self._now()
        if not frames:
            if t - self._heard > SILENT:
                self._frames, self.fault = None, f"the {self._camera.name} camera sends no frames"
            return None
        self._heard = t
        return self._exposure(self._align.process(frames), t)

    def _exposure(self, frames: Any, t: float) -> Exposure | None:
        color, depth = frames.get_color_frame(), frames.get_depth_frame()
        if not color or not depth:
            self.dropped += 1
            return None
        device = 1e-3 * color.get_timestamp()
        if device < self._newest - BACK:
            self._clock.reset()
        elif device <= self._newest:  # one of the two came again, with another partner
            return None
        self._newest, self.fault = device, ""
        self._clock.add(device, t)
        self._describe(color)
        latency = self._wall() - device
        by_wall = color.get_frame_timestamp_domain() != self._rs.timestamp_domain.hardware_clock
        stamp = t - latency if by_wall and 0.0 <= latency < MAX_LATENCY else self._clock.ours(device)
        rgb = np.array(color.get_data(), np.uint8)
        metres = np.asarray(depth.get_data()).astype(np.float32) * np.float32(depth.get_units())
        if self._maps is not None:
            rgb = np.asarray(cv2.remap(rgb, *self._maps, cv2.INTER_LINEAR), np.uint8)
            metres = np.asarray(cv2.remap(metres, *self._maps, cv2.INTER_NEAREST), np.float32)
        metres[(metres < self._camera.near) | (metres > self._camera.far)] = 0.0
        return Exposure(stamp, self._camera, rgb, metres)

    def _describe(self, color: Any) -> None:
        """Take what the device says of its lens, once for each stream."""
        profile = color.profile.as_video_stream_profile()
        if self._profile is not None and profile.unique_id() == self._profile.unique_id():
            return
        self._profile, lens = profile, profile.intrinsics
        self._camera = replace(
            self._camera, width=lens.width, height=lens.height, fx=lens.fx, fy=lens.fy, cx=lens.ppx, cy=lens.ppy
        )
        self._maps = None if not any(lens.coeffs) else self._straight(lens)

    def _straight(self, lens: Any) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return where each pixel of a camera without distortion is found in the image of `lens`."""
        found = np.empty((lens.height, lens.width, 2), np.float32)
        for v in range(lens.height):
            for u in range(lens.width):
                ray = [(u - lens.ppx) / lens.fx, (v - lens.ppy) / lens.fy, 1.0]
                found[v, u] = self._rs.rs2_project_point_to_pixel(lens, ray)
        return np.ascontiguousarray(found[..., 0]), np.ascontiguousarray(found[..., 1])
