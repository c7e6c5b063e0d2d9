"""A camera made of pyrealsense2's own software device: the library's frames, stamps and alignment, without a camera."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT = 64, 48


class SoftwareRealSense:
    """Delivers what it is given.

    Attributes:
        starts: how often it was started.
        gone: whether it is unplugged.
    """

    def __init__(self, rs: Any, coeffs: tuple[float, ...] = (0.0,) * 5, shift: float = 0.0) -> None:
        """Make a camera; `coeffs` distort its colour, and `shift` [m] is how far left of the colour the depth is."""
        self._rs, self._coeffs, self._shift = rs, coeffs, shift
        self.starts, self.number = 0, 0
        self.gone = False

    def start(self, record: str = "") -> Callable[[], Any]:
        """Start it anew; `record` is the file that its pictures go to instead."""
        rs = self._rs
        if self.gone:
            raise RuntimeError("no device connected")
        self.starts += 1
        device = self._device = rs.software_device()
        self._sensors = device.add_sensor("Depth"), device.add_sensor("Color")
        depth, color = self._sensors
        plain = (0.0,) * 5
        self._profiles = (
            depth.add_video_stream(self._stream(rs.stream.depth, 0, rs.format.z16, 2, plain)),
            color.add_video_stream(self._stream(rs.stream.color, 1, rs.format.rgb8, 3, self._coeffs)),
        )
        depth.add_read_only_option(rs.option.depth_units, 0.001)
        pose = rs.extrinsics()
        pose.rotation, pose.translation = [1, 0, 0, 0, 1, 0, 0, 0, 1], [self._shift, 0.0, 0.0]
        self._profiles[0].register_extrinsics_to(self._profiles[1], pose)
        device.create_matcher(rs.matchers.default)
        self._syncer = rs.syncer()
        self._recorder = rs.recorder(record, device) if record else None
        for sensor in (self._recorder or device).query_sensors():
            sensor.open(sensor.get_stream_profiles()[0])
            sensor.start(self._syncer)
        return self.frames

    def stop_recording(self) -> None:
        """End the recording."""
        assert self._recorder is not None
        for sensor in self._recorder.query_sensors():
            sensor.stop()
            sensor.close()
        self._recorder = None

    def frames(self) -> Any:
        """Return the next set of frames, None for none."""
        if self.gone:
            raise RuntimeError("device disconnected")
        found = self._syncer.poll_for_frames()
        return found if found and found.size() else None

    def show(self, stamp: float, depth: NDArray[np.uint16], color: NDArray[np.uint8], wall: bool = False) -> None:
        """Expose a picture at `stamp` [s] of the camera's clock, or of the `wall`'s; `depth` [mm], `color` rgb."""
        rs = self._rs
        self.number += 1
        pixels = (depth, color)
        for sensor, profile, image, size in zip(self._sensors, self._profiles, pixels, (2, 3), strict=True):
            frame = rs.software_video_frame()
            frame.pixels, frame.bpp, frame.stride = np.ascontiguousarray(image), size, size * WIDTH
            frame.timestamp, frame.frame_number = 1e3 * stamp, self.number
            frame.domain = rs.timestamp_domain.system_time if wall else rs.timestamp_domain.hardware_clock
            frame.profile = profile.as_video_stream_profile()
            if size == 2:
                frame.depth_units = 0.001
            sensor.on_video_frame(frame)
        time.sleep(0.02)  # the library hands frames on by threads of its own

    def _stream(self, kind: Any, uid: int, form: Any, size: int, coeffs: tuple[float, ...]) -> Any:
        rs = self._rs
        lens = rs.intrinsics()
        lens.width, lens.height, lens.fx, lens.fy = WIDTH, HEIGHT, 60.0, 61.0
        lens.ppx, lens.ppy, lens.coeffs = 31.5, 23.5, list(coeffs)
        lens.model = rs.distortion.brown_conrady if any(coeffs) else rs.distortion.none
        stream = rs.video_stream()
        stream.type, stream.index, stream.uid, stream.fmt, stream.bpp = kind, 0, uid, form, size
        stream.width, stream.height, stream.fps, stream.intrinsics = WIDTH, HEIGHT, 15, lens
        return stream
