"""Stereo depth as an active stereo camera delivers it, from the true depth.

Errors live in the disparity d = f B / z: noise of s pixels there is sigma_z = z^2 s / (f B) in depth, which is why
depth gets worse with the square of the distance. Part of the noise is white, part is spatially correlated (the
matching window smears it), and the disparity is quantised. Pixels have no depth where the second imager cannot see
the point (a band left of every near edge), where the surface is too oblique, on part of a specular surface, and out
of range. Not modelled: flying pixels at edges, interference, a static pattern, the offset of the colour imager.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.robots.sensors.cameras import HEAD, LEFT_HAND, RIGHT_HAND, rays
from golem.types import CameraInfo

Image = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Stereo:
    """The stereo pair behind a camera.

    Attributes:
        baseline: distance of the two imagers [m].
        focal: focal length of the pair at the width at which depth is streamed [px].
    """

    baseline: float
    focal: float


STEREO: dict[str, Stereo] = {
    # D435i: 90 deg across, so 424 px at 848 px width, here 640 px wide; its colour imager has a narrower lens.
    HEAD.name: Stereo(baseline=0.050, focal=424.0 * 640 / 848),
    # D405: colour comes from the left imager of the pair.
    LEFT_HAND.name: Stereo(baseline=0.018, focal=LEFT_HAND.fx),
    RIGHT_HAND.name: Stereo(baseline=0.018, focal=RIGHT_HAND.fx),
}
"""Stereo pair per camera (baselines and field of view: the maker's data sheets)."""


@dataclass(frozen=True, slots=True)
class DepthErrors:
    """Magnitudes of the errors of a stereo camera; the defaults leave only the range limits.

    Attributes:
        subpixel: RMS of the disparity noise [px].
        correlated: share of that variance which is spatially correlated, 0 to 1.
        patch: correlation length [px].
        disparity_step: quantum of the disparity [px]; 0 does not quantise.
        grazing: angle between ray and surface normal above which there is no depth [rad].
        specular_loss: share of a specular surface without depth, 0 to 1.
        occlusion: leave out what only one imager sees.
    """

    subpixel: float = 0.0
    correlated: float = 0.0
    patch: int = 8
    disparity_step: float = 0.0
    grazing: float = np.pi / 2
    specular_loss: float = 0.0
    occlusion: bool = False


class StereoDepth:
    """The depth channel of one camera, frame after frame; each frame draws fresh noise."""

    def __init__(self, info: CameraInfo, errors: DepthErrors, rng: np.random.Generator) -> None:
        """Serve the camera `info`, whose name must be in `STEREO`, with noise from the stream `rng`."""
        stereo = STEREO[info.name]
        self._info = info
        self._errors = errors
        self._rng = rng
        self._fB = np.float32(stereo.focal * stereo.baseline)
        # Disparity in pixels of the output image, whose focal length is the colour imager's.
        self._fB_image = np.float32(info.fx * stereo.baseline)
        self._u = np.arange(info.width, dtype=np.float32)
        ray = rays(info)
        self._x, self._y = ray[0, :, 0].copy(), ray[:, 0, 1:2].copy()
        self._oblique = np.float32(np.cos(errors.grazing) ** 2) * (ray * ray).sum(axis=2)

    def measure(self, depth: Image, specular: NDArray[np.bool_] | None = None) -> Image:
        """Return what the camera reports for one frame, (height, width) float32 [m], 0 where there is no depth.

        Args:
            depth: (height, width) true distance along the optical axis [m].
            specular: (height, width) True where the surface is a mirror-like one; None: nowhere.
        """
        e = self._errors
        valid = (depth >= self._info.near) & (depth <= self._info.far)
        inverse: Image = np.reciprocal(np.maximum(depth, np.float32(1e-3)), dtype=np.float32)
        if e.occlusion:
            valid &= self._seen_by_both(inverse)
        if e.grazing < np.pi / 2:
            valid &= self._faces_camera(inverse)
        if specular is not None and e.specular_loss > 0:
            # The logistic approximation of the normal quantile, within 0.02 in probability.
            p = np.clip(self._errors.specular_loss, 1e-6, 1 - 1e-6)
            valid &= ~(specular & (self._patches() < np.float32(np.log(p / (1 - p)) / 1.702)))
        if e.subpixel == 0 and e.disparity_step == 0:
            return np.where(valid, depth, np.float32(0))
        disparity = self._noise()
        disparity += inverse * self._fB
        if e.disparity_step > 0:
            disparity *= np.float32(1 / e.disparity_step)
            np.rint(disparity, out=disparity)
            disparity *= np.float32(e.disparity_step)
        valid &= disparity > 0
        np.maximum(disparity, np.float32(1e-3), out=disparity)
        np.divide(self._fB, disparity, out=disparity)
        disparity *= valid
        return disparity

    def _noise(self) -> Image:
        """Return (height, width) disparity noise [px]."""
        e = self._errors
        # Sum of four uniform bytes: normal to within 0.3 of excess kurtosis, at a third of the cost.
        word = self._rng.integers(0, 2**32, (self._info.height, self._info.width), dtype=np.uint32)
        pair = word & np.uint32(0x00FF00FF)
        word >>= np.uint32(8)
        word &= np.uint32(0x00FF00FF)
        pair += word
        pair *= np.uint32(0x00010001)
        pair >>= np.uint32(16)
        noise = pair.astype(np.float32)
        noise -= np.float32(2 * 255)
        noise *= np.float32(e.subpixel * np.sqrt(1 - e.correlated) / np.sqrt(4 * (256**2 - 1) / 12))
        if e.correlated > 0:
            noise += self._patches() * np.float32(e.subpixel * np.sqrt(e.correlated))
        return noise

    def _patches(self) -> Image:
        """Return (height, width) smooth normal noise of unit variance at every pixel."""
        height, width, patch = self._info.height, self._info.width, self._errors.patch
        nodes = (-(-width // patch) + 1, -(-height // patch) + 1)
        grid = self._rng.standard_normal(nodes, dtype=np.float32)
        return _stretch(np.ascontiguousarray(_stretch(grid, patch)[:width].T), patch)[:height]

    def _seen_by_both(self, inverse: Image) -> NDArray[np.bool_]:
        """Return (height, width) True where no nearer point to the right hides the point from the right imager."""
        column = self._u - self._fB_image * inverse
        minimum = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
        seen = np.ones(column.shape, np.bool_)
        # Half a pixel of slack, so that a steep surface does not hide itself.
        np.less_equal(column[:, :-1], minimum[:, 1:] + np.float32(0.5), out=seen[:, :-1])
        return seen

    def _faces_camera(self, inverse: Image) -> NDArray[np.bool_]:
        """Return (height, width) True where ray and surface normal enclose less than the grazing angle.

        On a plane n . p = k the inverse depth is w = (n . r) / k, linear in the image; its gradient is n / k.
        """
        nx, ny = np.zeros_like(inverse), np.zeros_like(inverse)
        np.subtract(inverse[:, 1:], inverse[:, :-1], out=nx[:, :-1])
        np.subtract(inverse[1:], inverse[:-1], out=ny[:-1])
        nx *= np.float32(self._info.fx)
        ny *= np.float32(self._info.fy)
        nz = inverse - nx * self._x
        nz -= ny * self._y
        # cos^2 = w^2 / (|n/k|^2 |r|^2)
        square = nx * nx
        square += ny * ny
        square += nz * nz
        square *= self._oblique
        return inverse * inverse > square


def _stretch(nodes: Image, patch: int) -> Image:
    """Interpolate (n, m) independent normal nodes to ((n - 1) patch, m) smooth values of the same variance."""
    t = ((np.arange(patch) + 0.5) / patch)[None, :, None]
    norm = np.sqrt(t**2 + (1 - t) ** 2)
    out = nodes[:-1, None] * ((1 - t) / norm).astype(np.float32)
    out += nodes[1:, None] * (t / norm).astype(np.float32)
    return out.reshape(-1, nodes.shape[1])
