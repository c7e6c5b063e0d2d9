from __future__ import annotations

import struct

import cv2
import numpy as np
import pytest

from golem.interfaces import images
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.msgs.sensor_msgs import Image, PointCloud2, PointField
from golem.types import CameraInfo

HEAD = CameraInfo("head", 64, 48, 60.0, 61.0, 31.5, 23.5, 0.1, 3.0, 15.0)


def picture() -> np.ndarray:
    rgb = np.zeros((48, 64, 3), np.uint8)
    rgb[:, :32, 0] = 255
    rgb[:, 32:, 2] = 255
    return rgb


def test_colour_survives() -> None:
    message = images.color_image(1.0, picture(), "camera_color_optical_frame")
    assert (message.encoding, message.step, message.data.size) == ("rgb8", 192, 48 * 192)
    np.testing.assert_array_equal(images.to_rgb(message), picture())


def test_rows_may_be_padded() -> None:
    padded = np.full((2, 10), 9, np.uint8)
    padded[:, :6] = np.arange(12).reshape(2, 6)
    message = Image(height=2, width=2, encoding="rgb8", step=10, data=padded.reshape(-1))
    assert images.to_rgb(message).reshape(-1).tolist() == list(range(12))


def test_jpeg_keeps_red_left_and_blue_right() -> None:
    message = images.color_jpeg(1.0, picture(), "camera")
    assert message.format == "rgb8; jpeg compressed bgr8"
    bgr = cv2.imdecode(message.data, cv2.IMREAD_COLOR)
    assert bgr is not None
    assert bgr[24, 8].tolist() == pytest.approx([0, 0, 255], abs=12)
    assert bgr[24, 56].tolist() == pytest.approx([255, 0, 0], abs=12)


def test_depth_is_in_millimetres_little_endian() -> None:
    message = images.depth_image(1.0, np.array([[0.0, 1.2344, 1.2346]], np.float32), "camera")
    assert (message.encoding, message.step, message.is_bigendian) == ("16UC1", 6, 0)
    assert struct.unpack("<3H", message.data.tobytes()) == (0, 1234, 1235)
    np.testing.assert_allclose(images.to_depth(message), [[0.0, 1.234, 1.235]], atol=1e-6)


def test_a_big_endian_depth_image_is_read() -> None:
    data = np.frombuffer(struct.pack(">2H", 1000, 2), np.uint8)
    message = Image(height=1, width=2, encoding="16UC1", is_bigendian=1, step=4, data=data)
    np.testing.assert_allclose(images.to_depth(message), [[1.0, 0.002]], atol=1e-7)


@pytest.mark.filterwarnings("error")
def test_what_no_sensor_measures_is_invalid() -> None:
    depth = np.array([[np.nan, np.inf, -np.inf, -0.5, 70.0, 65.535]], np.float32)
    assert images.millimetres(depth).tolist() == [[0, 0, 0, 0, 0, 65535]]


def test_compressed_depth_is_a_png_behind_twelve_bytes() -> None:
    depth = np.random.default_rng(3).uniform(0.2, 3.0, (48, 64)).astype(np.float32)
    message = images.depth_png(1.0, depth, "camera")
    assert message.format == "16UC1; compressedDepth png"
    assert message.data[:12].tolist() == [0] * 12
    decoded = cv2.imdecode(message.data[12:], cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(decoded, images.millimetres(depth))


def test_intrinsics_survive() -> None:
    message = images.camera_info(1.0, HEAD, "camera")
    assert message.k.reshape(3, 3)[:2].tolist() == [[60.0, 0.0, 31.5], [0.0, 61.0, 23.5]]
    assert message.p.reshape(3, 4)[:, :3].tolist() == message.k.reshape(3, 3).tolist()
    assert images.to_camera(message, "head", 0.1, 3.0, 15.0) == HEAD


@pytest.mark.parametrize(
    ("where", "value", "said"), [(0, np.nan, "fx nan"), (0, np.inf, "fx inf"), (2, np.nan, "cx nan")]
)
def test_a_camera_whose_numbers_are_none_is_refused(where: int, value: float, said: str) -> None:
    message = images.camera_info(1.0, HEAD, "camera")
    message.k[where] = value
    with pytest.raises(CodecError, match=said):
        images.to_camera(message, "head", 0.1, 3.0, 15.0)


@pytest.mark.parametrize(
    "changed", [{"encoding": "bgr8"}, {"step": 100}, {"height": 49}, {"width": 0xFFFFFFFF}, {"step": 0xFFFFFFFF}]
)
def test_an_image_that_contradicts_itself_is_refused(changed: dict[str, object]) -> None:
    message = images.color_image(1.0, picture(), "camera")
    for name, value in changed.items():
        setattr(message, name, value)
    with pytest.raises(CodecError):
        images.to_rgb(message)


def test_the_livox_cloud_has_the_drivers_layout() -> None:
    points = np.zeros(3, images.LIVOX_POINT)
    points["x"], points["line"], points["timestamp"] = [1.0, 2.0, 3.0], 7, [0.0, 1e5, 2e5]
    message = images.point_cloud(1.0, points, "lidar_link")
    assert (message.height, message.width, message.point_step, message.row_step) == (1, 3, 26, 78)
    described = [(f.name, f.offset, f.datatype) for f in message.fields]
    assert described == [
        ("x", 0, PointField.FLOAT32),
        ("y", 4, PointField.FLOAT32),
        ("z", 8, PointField.FLOAT32),
        ("intensity", 12, PointField.FLOAT32),
        ("tag", 16, PointField.UINT8),
        ("line", 17, PointField.UINT8),
        ("timestamp", 18, PointField.FLOAT64),
    ]
    np.testing.assert_array_equal(images.to_points(message), points)


def test_bare_coordinates_make_a_cloud() -> None:
    message = images.point_cloud(1.0, np.array([[1.0, 2.0, 3.0], [4.0, 5.0, np.nan]]), "odom")
    assert message.point_step == 12 and not message.is_dense
    assert images.to_points(message)["y"].tolist() == [2.0, 5.0]
    assert len(images.to_points(images.point_cloud(1.0, np.zeros((0, 3)), "odom"))) == 0


@pytest.mark.parametrize(
    "changed",
    [
        {"width": 4},
        {"height": 0xFFFFFFFF},
        {"point_step": 0},
        {"point_step": 11},
        {"row_step": 0},
        {"fields": [PointField("x", 0, 99, 1)]},
        {"fields": [PointField("x", 10, PointField.FLOAT32, 1)]},
        {"fields": [PointField("x", 0, PointField.UINT8, 0xFFFFFFFF)]},
        {"fields": [PointField("x", 0, PointField.FLOAT32, 1)] * 2},
    ],
)
def test_a_cloud_that_contradicts_itself_is_refused(changed: dict[str, object]) -> None:
    message: PointCloud2 = images.point_cloud(1.0, np.ones((3, 3)), "odom")
    for name, value in changed.items():
        setattr(message, name, value)
    with pytest.raises(CodecError, match="does not agree"):
        images.to_points(message)
