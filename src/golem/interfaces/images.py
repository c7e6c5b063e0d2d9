"""Camera frames and point clouds as ROS messages and back, and lenses that bend what they show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.interfaces.ros_convert import header
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.msgs.sensor_msgs import CameraInfo, CompressedImage, Image, PointCloud2, PointField
from golem.types import CameraInfo as Camera

Maps = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Column and row (height, width) in the camera's image for each pixel of the straight one [px]."""
MODELS: dict[str, tuple[int, ...]] = {
    "plumb_bob": (4, 5),
    "rational_polynomial": (8, 12, 14),
    "equidistant": (4,),
    "fisheye": (4,),
}
"""How many coefficients each model of distortion has (sensor_msgs/distortion_models.hpp, OpenCV's calib3d)."""
_FISHEYE = ("equidistant", "fisheye")


@dataclass(frozen=True, slots=True, eq=False)
class Lens:
    """A camera as a CameraInfo describes it.

    Attributes:
        camera: the pinhole camera of its straightened images.
        distortion: coefficients; empty where it bends nothing.
        fisheye: whether they are those of such a lens.
    """

    camera: Camera
    distortion: tuple[float, ...] = ()
    fisheye: bool = False

    def straighten(
        self, rgb: NDArray[np.uint8], depth: NDArray[np.float32]
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return colour (height, width, 3) and depth (height, width) [m] without distortion; 0 beyond the image."""
        if not self.distortion:
            return rgb, depth
        # Made when there are images: whatever size a message claims takes no memory before.
        maps = _maps(self.camera, self.fisheye, self.distortion)
        import cv2

        straight = (cv2.remap(rgb, *maps, cv2.INTER_LINEAR), cv2.remap(depth, *maps, cv2.INTER_NEAREST))
        return np.asarray(straight[0], np.uint8), np.asarray(straight[1], np.float32)


def to_lens(message: CameraInfo, name: str, near: float, far: float, rate: float) -> Lens:
    """Return the lens that a CameraInfo describes; the arguments are those of `to_camera`.

    Raises CodecError: see `to_camera`, or the distortion's model is unknown, or has not its coefficients.
    """
    camera = to_camera(message, name, near, far, rate)
    if not message.d.any():
        return Lens(camera)
    model, d = message.distortion_model, message.d
    if len(d) not in MODELS.get(model, ()) or not np.isfinite(d).all():
        raise CodecError(
            f"A camera with the distortion '{model[:30]}' and {len(d)} coefficients: valid are finite ones of "
            f"{', '.join(f'{m} ({len_[0]})' for m, len_ in MODELS.items())}."
        )
    return Lens(camera, tuple(d.tolist()), model in _FISHEYE)


@lru_cache(maxsize=8)
def _maps(camera: Camera, fisheye: bool, d: tuple[float, ...]) -> Maps:
    import cv2

    K = np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])
    size, eye = (camera.width, camera.height), np.eye(3)
    make = cv2.fisheye.initUndistortRectifyMap if fisheye else cv2.initUndistortRectifyMap
    column, row = make(K, np.array(d), eye, K, size, cv2.CV_32FC1)
    return np.asarray(column, np.float32), np.asarray(row, np.float32)


JPEG_QUALITY = 80
"""Quality of compressed colour images, 0 to 100 [the original's]."""
DEPTH_HEADER = bytes(12)
"""What precedes the PNG of a depth image: format int32, 0 = INV_DEPTH, and its two float32 parameters, which 16-bit
depth does not use (ros-perception/image_transport_plugins, compressed_depth_image_transport, compression_common.h)."""
COLOR_FORMAT = "rgb8; jpeg compressed bgr8"
DEPTH_FORMAT = "16UC1; compressedDepth png"
"""What the decoders of image_transport look for."""

LIVOX_POINT = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "tag", "line", "timestamp"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "u1", "u1", "<f8"],
        "offsets": [0, 4, 8, 12, 16, 17, 18],
        "itemsize": 26,
    }
)
"""A point of /livox/pointcloud, as the vendor's driver packs it: x, y, z [m], intensity, tag, line, time [ns]."""
_POINT_TYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
"""`PointField.datatype` by numpy's name of it."""


def color_image(t: float, rgb: NDArray[np.uint8], frame: str) -> Image:
    """Return a colour image (height, width, 3), exposed at `t` [s]."""
    height, width, _ = rgb.shape
    return Image(header(t, frame), height, width, "rgb8", 0, 3 * width, np.ascontiguousarray(rgb).reshape(-1))


def color_jpeg(t: float, rgb: NDArray[np.uint8], frame: str) -> CompressedImage:
    """Return a colour image (height, width, 3) as JPEG."""
    import cv2

    _, data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return CompressedImage(header(t, frame), COLOR_FORMAT, data.reshape(-1))


def depth_image(t: float, depth: NDArray[np.float32], frame: str) -> Image:
    """Return a depth image (height, width) [m], in which 0 is invalid, in whole millimetres."""
    height, width = depth.shape
    data = millimetres(depth).reshape(-1).view(np.uint8)
    return Image(header(t, frame), height, width, "16UC1", 0, 2 * width, data)


def depth_png(t: float, depth: NDArray[np.float32], frame: str) -> CompressedImage:
    """Return a depth image (height, width) [m] as PNG of whole millimetres behind a header."""
    import cv2

    # OpenCV's own choice, run lengths of differences to the left, is as cheap as zlib gets: it is the noise that costs.
    _, png = cv2.imencode(".png", millimetres(depth))
    data = np.concatenate((np.frombuffer(DEPTH_HEADER, np.uint8), png.reshape(-1)))
    return CompressedImage(header(t, frame), DEPTH_FORMAT, data)


def millimetres(depth: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Return depth [m] as whole millimetres; 0 where it is not finite, negative or beyond 65.535 m."""
    scaled = depth * np.float32(1000.0)
    scaled += np.float32(0.5)
    valid = (scaled >= 0.0) & (scaled < 65536.0)  # NaN compares false with everything
    if not valid.all():
        scaled[~valid] = 0.0
    return scaled.astype("<u2")


def camera_info(t: float, camera: Camera, frame: str) -> CameraInfo:
    """Return the intrinsics of a camera without distortion."""
    k = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    p = [camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return CameraInfo(
        header=header(t, frame),
        height=camera.height,
        width=camera.width,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=np.array(k),
        r=np.eye(3).reshape(-1),
        p=np.array(p),
    )


def to_camera(message: CameraInfo, name: str, near: float, far: float, rate: float) -> Camera:
    """Return the pinhole camera that a CameraInfo describes, by its K, region and binning; see `Lens` for distortion.

    ROS says nothing of its name, depth range [m] and rate [Hz]. Region and binning are counted as by image_geometry
    (ros-perception/vision_opencv, pinhole_camera_model): K is that of the whole image, both of 0 are no region, 0 is 1.
    Raises CodecError: a focal length is not positive, a number is not finite, K is skewed, or the region is outside.
    """
    fx, skew, cx, low, fy, cy = message.k[:6].tolist()
    finite = bool(np.isfinite([fx, fy, cx, cy]).all())
    if not (finite and fx > 0.0 and fy > 0.0 and message.width and message.height):
        raise CodecError(
            f"A camera of {message.width} x {message.height} pixels with fx {fx:g}, fy {fy:g}, cx {cx:g}, cy {cy:g}."
        )
    if not (abs(skew) < 1e-3 and abs(low) < 1e-3):
        raise CodecError(f"A camera with a skew of {skew or low:g} pixels; a pinhole camera's axes are square.")
    roi, bin_x, bin_y = message.roi, max(message.binning_x, 1), max(message.binning_y, 1)
    width, height = roi.width or message.width, roi.height or message.height
    inside = roi.x_offset + width <= message.width and roi.y_offset + height <= message.height
    if not inside or width < bin_x or height < bin_y:
        raise CodecError(
            f"A region of {width} x {height} pixels at ({roi.x_offset}, {roi.y_offset}), binned {bin_x} x {bin_y}, of "
            f"a camera of {message.width} x {message.height} pixels."
        )
    cx, cy = (cx - roi.x_offset) / bin_x, (cy - roi.y_offset) / bin_y
    return Camera(name, width // bin_x, height // bin_y, fx / bin_x, fy / bin_y, cx, cy, near, far, rate)


def to_rgb(message: Image) -> NDArray[np.uint8]:
    """Return a colour image (height, width, 3). Raises CodecError: it is not rgb8, or has other bytes than it says."""
    return np.ascontiguousarray(_rows(message, "rgb8", 3)).reshape(message.height, message.width, 3)


def to_depth(message: Image) -> NDArray[np.float32]:
    """Return a depth image (height, width) [m]. Raises CodecError: it is not 16UC1, or has other bytes than it says."""
    pixels = np.ascontiguousarray(_rows(message, "16UC1", 2))
    order = ">u2" if message.is_bigendian else "<u2"
    return pixels.view(order).astype(np.float32) * np.float32(0.001)


def point_cloud(t: float, points: NDArray[Any], frame: str) -> PointCloud2:
    """Return a point cloud.

    Args:
        t: time of the first point [s].
        points: (n,) structured array, little endian, whose fields become those of the cloud; or (n, 3) x, y, z [m].
        frame: what the coordinates are in.
    """
    if points.dtype.names is None:
        xyz = np.ascontiguousarray(points, "<f4").reshape(-1, 3)
        points = xyz.view([("x", "<f4"), ("y", "<f4"), ("z", "<f4")]).reshape(-1)
    fields = [
        PointField(name, offset, _POINT_TYPES[kind.str[1:]], 1)
        for name, (kind, offset, *_) in (points.dtype.fields or {}).items()
    ]
    size = points.dtype.itemsize
    data = np.ascontiguousarray(points).view(np.uint8).reshape(-1)
    dense = all(bool(np.isfinite(points[name]).all()) for name in ("x", "y", "z"))
    return PointCloud2(header(t, frame), 1, len(points), fields, False, size, size * len(points), data, dense)


def to_points(message: PointCloud2) -> NDArray[Any]:
    """Return the points of a cloud as a structured array (height * width,) with the cloud's fields.

    Raises CodecError: the cloud's fields or sizes contradict each other.
    """
    order = ">" if message.is_bigendian else "<"
    kinds = {number: kind for kind, number in _POINT_TYPES.items()}
    names = [field.name for field in message.fields]
    sizes = [(f.offset, kinds.get(f.datatype), f.count) for f in message.fields]
    count = message.height * message.width
    sound = (
        0 < message.point_step < 1 << 16
        and len(set(names)) == len(names)
        and message.row_step == message.width * message.point_step
        and message.data.size == count * message.point_step
        and all(kind and 1 <= n and at + n * int(kind[1]) <= message.point_step for at, kind, n in sizes)
    )
    if not sound:
        raise CodecError(
            f"A cloud of {message.height} x {message.width} points of {message.point_step} bytes with "
            f"{len(names)} fields does not agree with its {message.data.size} bytes."
        )
    formats = [order + str(kind) if n == 1 else (order + str(kind), (n,)) for _, kind, n in sizes]
    offsets = [offset for offset, *_ in sizes]
    point = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": message.point_step})
    return np.frombuffer(message.data, point)


def _rows(message: Image, encoding: str, pixel: int) -> NDArray[np.uint8]:
    """Return the (height, width * pixel) bytes of an image without the padding of its rows."""
    width = message.width * pixel
    if message.encoding != encoding:
        raise CodecError(f"The image is '{message.encoding[:20]}', not '{encoding}'.")
    if message.step < width or message.data.size != message.height * message.step:
        raise CodecError(
            f"An image of {message.width} x {message.height} pixels with rows of {message.step} bytes does not have "
            f"{message.data.size} bytes."
        )
    return message.data.reshape(message.height, message.step)[:, :width]


class Pairing:
    """Puts the two images of each exposure of one camera together, in whichever order they come."""

    def __init__(self, take: Callable[[Image, Image], None]) -> None:
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
