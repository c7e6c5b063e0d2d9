"""Lenses of a CameraInfo: straight lines come out straight, regions and binning count, the unknown is refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from golem.interfaces.images import Lens, to_camera, to_lens
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.msgs.sensor_msgs import CameraInfo, RegionOfInterest

K = np.array([[600.0, 0.0, 320.0], [0.0, 610.0, 240.0], [0.0, 0.0, 1.0]])
DISTORTIONS = {
    "plumb_bob": [0.15, -0.3, 0.001, 0.0, 0.1],
    "plumb_bob of four": [-0.2, 0.05, 0.001, -0.002],
    "rational_polynomial": [0.15, -0.3, 0.001, 0.0, 0.1, 0.02, -0.01, 0.003],
    "equidistant": [0.2, 0.1, 0.0, 0.0],
    "fisheye": [-0.05, 0.01, -0.002, 0.0],
}


def info(**fields: object) -> CameraInfo:
    message = CameraInfo(width=640, height=480, k=K.reshape(-1).copy(), distortion_model="plumb_bob", d=np.zeros(5))
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def lens(**fields: object) -> Lens:
    return to_lens(info(**fields), "head", 0.1, 3.0, 15.0)


@pytest.mark.parametrize("name", DISTORTIONS)
def test_a_point_is_where_a_pinhole_camera_sees_it(name: str) -> None:
    model, d = name.partition(" ")[0], np.array(DISTORTIONS[name])
    points = np.array([[0.3, 0.2, 1.2], [-0.25, 0.18, 1.0], [0.02, -0.3, 1.1], [0.0, 0.0, 1.0]])
    if model in ("equidistant", "fisheye"):
        seen = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), K, d)[0].reshape(-1, 2)
    else:
        seen = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, d)[0].reshape(-1, 2)
    rgb: NDArray[np.uint8] = np.zeros((480, 640, 3), np.uint8)
    depth: NDArray[np.float32] = np.zeros((480, 640), np.float32)
    for (x, y), point in zip(seen, points, strict=True):
        cv2.circle(rgb, (round(16 * x), round(16 * y)), 16 * 6, (255, 255, 255), -1, cv2.LINE_AA, 4)
        cv2.circle(depth, (round(x), round(y)), 6, float(point[2]), -1)  # pyright: ignore[reportCallIssue, reportArgumentType]
    one = lens(distortion_model=model, d=d)
    straight, metres = one.straighten(rgb, depth)
    camera = one.camera
    for x, y, z in points:
        u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
        near = np.zeros((480, 640), bool)
        near[round(v) - 12 : round(v) + 13, round(u) - 12 : round(u) + 13] = True
        weight = np.where(near, straight[..., 0], 0).astype(float)
        rows, columns = np.mgrid[:480, :640]
        middle = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
        np.testing.assert_allclose(middle, [u, v], atol=0.25)
        assert metres[round(v), round(u)] == pytest.approx(z)


def test_without_distortion_images_are_left_alone() -> None:
    rgb, depth = np.ones((480, 640, 3), np.uint8), np.ones((480, 640), np.float32)
    for model in ("plumb_bob", "", "none", "mine"):
        one = lens(distortion_model=model, d=np.zeros(0 if model else 5))
        assert one.distortion == () and one.straighten(rgb, depth)[0] is rgb


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"binning_x": 2, "binning_y": 2}, (320, 240, 300.0, 305.0, 160.0, 120.0)),
        ({"binning_x": 1, "binning_y": 0}, (640, 480, 600.0, 610.0, 320.0, 240.0)),
        ({"roi": RegionOfInterest(40, 30, 200, 300)}, (300, 200, 600.0, 610.0, 280.0, 210.0)),
        ({"roi": RegionOfInterest(40, 30, 200, 300), "binning_x": 4}, (75, 200, 150.0, 610.0, 70.0, 210.0)),
        ({"roi": RegionOfInterest(0, 0, 480, 640, True)}, (640, 480, 600.0, 610.0, 320.0, 240.0)),
    ],
)
def test_regions_and_binning_count(fields: dict[str, object], expected: tuple[float, ...]) -> None:
    camera = to_camera(info(**fields), "head", 0.1, 3.0, 15.0)
    assert (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) == expected


def test_a_size_that_nobody_has_takes_no_memory() -> None:
    one = lens(width=0xFFFFFFFF, height=0xFFFFFFFF, d=np.array([0.1, 0, 0, 0, 0]))
    assert one.camera.width == 0xFFFFFFFF and one.distortion


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        (
            {"distortion_model": "kannala", "d": np.ones(4)},
            r"'kannala' and 4 coefficients: valid are .*plumb_bob \(5|plumb",
        ),
        ({"d": np.ones(3)}, "'plumb_bob' and 3 coefficients"),
        ({"distortion_model": "equidistant", "d": np.ones(5)}, "'equidistant' and 5"),
        ({"d": np.array([np.nan, 0, 0, 0, 0])}, "finite"),
        ({"k": np.array([600.0, 30, 320, 0, 600, 240, 0, 0, 1])}, "a skew of 30 pixels"),
        ({"roi": RegionOfInterest(600, 0, 100, 100)}, r"region of 100 x 100 pixels at \(600, 0\)"),
        ({"binning_x": 1000}, "binned 1000 x 1"),
    ],
)
def test_what_no_image_can_be_made_of_is_refused(fields: dict[str, object], said: str) -> None:
    with pytest.raises(CodecError, match=said):
        lens(**fields)
