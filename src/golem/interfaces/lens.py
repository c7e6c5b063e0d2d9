"""What a CameraInfo says of a lens: images of one that bends straight lines are straightened."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from golem.interfaces.images import to_camera
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.msgs.sensor_msgs import CameraInfo
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
        """Return colour (height, width, 3) and depth (height, width) [m] of the camera's size without distortion.

        They are 0 beyond the image.
        """
        if not self.distortion:
            return rgb, depth
        # Made when there are images: whatever size a message claims takes no memory before.
        maps = _maps(self.camera, self.fisheye, self.distortion)
        import cv2

        straight = (cv2.remap(rgb, *maps, cv2.INTER_LINEAR), cv2.remap(depth, *maps, cv2.INTER_NEAREST))
        return np.asarray(straight[0], np.uint8), np.asarray(straight[1], np.float32)


def to_lens(message: CameraInfo, name: str, near: float, far: float, rate: float) -> Lens:
    """Return the lens that a CameraInfo describes; the arguments are those of `to_camera`.

    Raises:
        CodecError: see `to_camera`, or the distortion's model is unknown, or has not its coefficients.
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
