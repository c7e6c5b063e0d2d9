from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.hardware.drivers.software_realsense import HEIGHT, WIDTH, SoftwareRealSense

from golem.errors import MissingExtra
from golem.hardware.drivers import realsense_camera
from golem.hardware.drivers.realsense_camera import CameraError, RealSense, device_frames
from golem.interfaces.payloads import Exposure
from golem.robots.sensors.cameras import HEAD

rs: Any = pytest.importorskip("pyrealsense2", exc_type=ImportError)

FLAT: NDArray[np.uint16] = np.full((HEIGHT, WIDTH), 1000, np.uint16)
GREY: NDArray[np.uint8] = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)


@dataclass
class Rig:
    """A camera, its driver and its clocks."""

    device: SoftwareRealSense = field(default_factory=lambda: SoftwareRealSense(rs))
    now: float = 500.0
    wall: float = 1_700_000_000.0

    def __post_init__(self) -> None:
        self.camera = RealSense(HEAD, self.device.start, lambda: self.now, lambda: self.wall)

    def look(self, dt: float) -> Exposure | None:
        """Let `dt` [s] pass and take what has come."""
        self.now += dt
        self.wall += dt
        found = None
        for _ in range(10):  # the library may hand a picture on in two sets
            found = self.camera.step() or found
        return found

    def warm_up(self, stamp: float, **picture: Any) -> None:
        """Expose the first picture, of which the library hands only the depth on."""
        self.device.show(stamp, picture.pop("depth", FLAT), picture.pop("color", GREY), **picture)
        self.look(0.066)

    def see(self, stamp: float, dt: float = 0.066, **picture: Any) -> Exposure:
        """Expose one picture and take it."""
        self.device.show(stamp, picture.pop("depth", FLAT), picture.pop("color", GREY), **picture)
        exposure = self.look(dt)
        for _ in range(200):
            if exposure is not None:
                return exposure
            sleep(0.01)
            exposure = self.look(0.0)
        raise AssertionError("no picture came")


def test_a_picture_is_that_of_the_device() -> None:
    rig = Rig()
    color = GREY.copy()
    color[10, 20] = (255, 1, 2)
    depth = FLAT.copy()
    depth[30, 40] = 1234
    rig.warm_up(0.0)
    seen = rig.see(0.066, depth=depth, color=color)
    assert (seen.info.name, seen.info.width, seen.info.height) == ("head", WIDTH, HEIGHT)
    assert (seen.info.fx, seen.info.fy, seen.info.cx, seen.info.cy) == (60.0, 61.0, 31.5, 23.5)
    assert seen.rgb.dtype == np.uint8 and tuple(seen.rgb[10, 20]) == (255, 1, 2)
    assert seen.depth.dtype == np.float32 and seen.depth[30, 40] == pytest.approx(1.234)
    assert seen.depth[5, 5] == pytest.approx(1.0)


def test_depth_outside_the_range_is_none() -> None:
    depth = FLAT.copy()
    depth[0, 0], depth[0, 1], depth[0, 2] = 100, 3500, 0
    rig = Rig()
    rig.warm_up(0.0)
    assert rig.see(0.066, depth=depth).depth[0, :4].tolist() == [0.0, 0.0, 0.0, pytest.approx(1.0)]


def test_depth_is_aligned_to_colour() -> None:
    rig = Rig(SoftwareRealSense(rs, shift=0.1))
    depth = np.zeros((HEIGHT, WIDTH), np.uint16)
    depth[20:28, 20:28] = 1000
    rig.warm_up(0.0, depth=depth)
    rows, columns = np.nonzero(rig.see(0.066, depth=depth).depth)
    assert columns.mean() == pytest.approx(23.5 + 60.0 * 0.1 / 1.0, abs=0.6)
    assert rows.mean() == pytest.approx(23.5, abs=0.6)


def test_distortion_is_taken_out() -> None:
    coeffs = (-0.2, 0.05, 0.0, 0.0, 0.0)
    rig = Rig(SoftwareRealSense(rs, coeffs))
    lens = rs.intrinsics()
    lens.width, lens.height, lens.fx, lens.fy, lens.ppx, lens.ppy = WIDTH, HEIGHT, 60.0, 61.0, 31.5, 23.5
    lens.model, lens.coeffs = rs.distortion.brown_conrady, list(coeffs)
    point = (0.4, -0.25, 1.0)
    u, v = rs.rs2_project_point_to_pixel(lens, list(point))
    color = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    color[round(v) - 1 : round(v) + 2, round(u) - 1 : round(u) + 2] = 250
    rig.warm_up(0.0)
    rows, columns = np.nonzero(rig.see(0.066, color=color).rgb[..., 0] > 120)
    assert columns.mean() == pytest.approx(31.5 + 60.0 * point[0], abs=0.8)
    assert rows.mean() == pytest.approx(23.5 + 61.0 * point[1], abs=0.8)
    assert abs(u - (31.5 + 60.0 * point[0])) > 1.0  # so that it matters


def test_stamps_of_the_wall_clock_become_ours() -> None:
    rig = Rig()
    rig.warm_up(rig.wall + 0.006, wall=True)
    seen = rig.see(rig.wall + 0.026, wall=True)  # exposed 40 ms before it is looked at
    assert seen.t == pytest.approx(rig.now - 0.040, abs=1e-3)


def test_stamps_of_the_cameras_own_clock_become_ours_by_the_quickest_picture() -> None:
    rig = Rig()
    rig.warm_up(0.0)
    times = [rig.see(0.066 * (i + 1), dt=0.066 + (0.02 if i == 3 else -0.02 if i == 4 else 0.0)).t for i in range(8)]
    assert np.diff(times) == pytest.approx(0.066, abs=1e-3)
    assert times[-1] == pytest.approx(rig.now, abs=1e-3)


def test_an_old_recordings_wall_clock_is_not_believed() -> None:
    rig = Rig()
    rig.warm_up(1.0e9, wall=True)
    assert rig.see(1.0e9 + 0.066, wall=True).t == pytest.approx(rig.now, abs=0.01)


def test_a_camera_that_is_unplugged_says_so_and_comes_back() -> None:
    rig = Rig()
    rig.warm_up(0.0)
    for i in range(1, 6):
        rig.see(0.066 * i)
    rig.device.gone = True
    assert rig.look(0.1) is None and "disconnected" in rig.camera.fault
    assert rig.look(1.1) is None and "no device" in rig.camera.fault
    rig.device.gone = False
    assert rig.look(0.5) is None and rig.device.starts == 1
    assert rig.look(0.6) is None
    rig.warm_up(0.0)
    assert rig.see(0.066).t == pytest.approx(rig.now, abs=1e-3)  # its clock began anew
    assert rig.camera.fault == "" and rig.device.starts == 2


def test_a_camera_that_falls_silent_is_started_again() -> None:
    rig = Rig()
    rig.warm_up(0.0)
    rig.see(0.066)
    assert rig.look(0.9) is None and rig.camera.fault == ""
    assert rig.look(0.3) is None and rig.camera.fault == "the head camera sends no frames"
    rig.look(0.1)
    assert rig.device.starts == 2


def test_a_recording_is_played_through_the_librarys_own_pipeline(tmp_path: Path) -> None:
    device = SoftwareRealSense(rs)
    device.start(record=str(tmp_path / "camera.db3"))
    for i in range(8):
        device.show(0.066 * i, FLAT, np.full_like(GREY, 10 * i))
    device.stop_recording()
    camera = RealSense(HEAD, partial(device_frames, HEAD, str(tmp_path / "camera.db3")))
    seen = list[Exposure]()
    end = monotonic() + 20.0
    while len(seen) < 5 and monotonic() < end:
        exposure = camera.step()
        seen += [] if exposure is None else [exposure]
    assert len(seen) == 5 and seen[0].rgb.shape == (HEIGHT, WIDTH, 3)
    assert all(picture.rgb[0, 0, 0] % 10 == 0 for picture in seen)
    assert seen[-1].depth[5, 5] == pytest.approx(1.0) and seen[-1].info.fx == 60.0


def test_a_camera_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CameraError, match="No camera or recording '000000' with 640 x 480"):
        device_frames(replace(HEAD), "000000")
    monkeypatch.setitem(__import__("sys").modules, "pyrealsense2", None)
    with pytest.raises(MissingExtra, match=r"golem-humanoid\[realsense\]"):
        realsense_camera.library()
