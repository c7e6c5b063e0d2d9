"""Detections to space: which depth inside a box is the object's, and its points in odom.

A box holds object and background, and the mean of both is neither. What stands proud of its ground (a screw, a nut, a
bus bar) is the nearest mode of the depths around the centre. What is flush (a hole's surroundings, a tray's floor) is
the greatest mode. Modes are taken in a window small enough that a surface seen at 45 degrees still is one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.robots.sensors.cameras import rays
from golem.types import Array, Detection, LocalizedObject, Mask, RgbdImage


@dataclass(frozen=True, slots=True)
class LiftConfig:
    """How depth is read.

    Attributes:
        window: share of the box, around the centre, where the object's depth is looked for.
        min_window: smallest half side of that window [px].
        max_window: greatest half side [px].
        grow: how far the box of the point cloud exceeds the detection, as a share of its size, so that the ground
            around the object is in the cloud.
        near_share: smallest share of the window's valid depths that counts as a mode of its own.
        bin: width of a mode at the camera [m].
        bin_growth: growth of that width with the squared distance [1/m]; stereo noise grows so.
        min_valid: smallest number of valid depths in the window.
        flush: labels whose depth is the greatest mode.
        around: labels whose depth is looked for in the grown box, as their inside is deeper.
        standing: labels of what rises from its ground: seen behind most of its grown box, it is a hole, and is dropped.
        sunk: how far behind [m]; `bin` and `bin_growth` come on top.
    """

    window: float = 0.6
    min_window: int = 2
    max_window: int = 8
    grow: float = 0.3
    near_share: float = 0.2
    bin: float = 0.002
    bin_growth: float = 0.008
    min_valid: int = 5
    flush: tuple[str, ...] = ("screw_hole", "tray")
    around: tuple[str, ...] = ("screw_hole",)
    standing: tuple[str, ...] = ("screw", "nut")
    sunk: float = 0.005

    def width(self, depth: float) -> float:
        """Return the width of a mode at a depth [m]."""
        return self.bin + self.bin_growth * depth**2


def surface_depth(depths: NDArray[np.float32], config: LiftConfig, *, flush: bool) -> float | None:
    """Return the depth of the object among the depths of a window, or None when too few are valid.

    Args:
        depths: any shape [m]; 0 or not finite where invalid.
        config: widths and shares of the modes.
        flush: take the greatest mode, else the nearest that is a mode at all.
    """
    valid = np.sort(depths[np.isfinite(depths) & (depths > 0)].astype(np.float64))
    if len(valid) < config.min_valid:
        return None
    width = config.width(float(np.median(valid)))
    # For every depth, how many lie within one width behind it.
    last = np.searchsorted(valid, valid + width, side="right")
    counts = last - np.arange(len(valid))
    if flush:
        start = int(np.argmax(counts))
    else:
        first = int(np.argmax(counts >= max(config.near_share * len(valid), config.min_valid / 2)))
        # Slide to the densest place of this nearest mode: the first qualifying window may hold only its front edge.
        reach = int(np.searchsorted(valid, valid[first] + width, side="right"))
        start = first + int(np.argmax(counts[first:reach]))
    return float(np.median(valid[start : last[start]]))


def lift(frame: RgbdImage, detection: Detection, config: LiftConfig) -> LocalizedObject | None:
    """Return the detection in space, or None when its depth is not valid, or that of a hole.

    Its position is the surface point seen at the detection's centre; for a hole the centre of its mouth. Its points and
    its mask are all valid depths in the grown box: the object and the ground around it.
    """
    low, high = detection.box[:2], detection.box[2:]
    cloud = _window(frame, low - config.grow * (high - low) - 0.5, high + config.grow * (high - low) + 0.5)
    if detection.label in config.around:
        window = cloud
    else:
        half = np.clip(config.window * (high - low) / 2, config.min_window, config.max_window)
        window = _window(frame, detection.center - half, detection.center + half)
    depth = surface_depth(frame.depth[window], config, flush=detection.label in config.flush)
    if depth is None:
        return None
    info = frame.info
    x, y = detection.center
    ray = np.array([(x - info.cx) / info.fx, (y - info.cy) / info.fy, 1.0])
    position = _transform(frame.T_odom_optical, ray * depth)
    rows, columns = cloud
    inside = frame.depth[cloud]
    mask = Mask(np.isfinite(inside) & (inside > 0), columns.start, rows.start)
    if detection.label in config.standing and depth > np.median(inside[mask.pixels]) + config.sunk + config.width(
        depth
    ):
        return None
    return LocalizedObject(detection, frame.t, position, unproject(frame, mask), mask)


def scene_of(frame: RgbdImage) -> Array:
    """Return the (n, 3) points in odom of all pixels of `frame` whose depths are valid, row by row [m]."""
    return unproject(frame, Mask(np.isfinite(frame.depth) & (frame.depth > 0), 0, 0))


def unproject(frame: RgbdImage, mask: Mask) -> Array:
    """Return the (n, 3) points in odom of the n pixels of `mask`, whose depths are valid, row by row [m]."""
    height, width = mask.pixels.shape
    window = slice(mask.y, mask.y + height), slice(mask.x, mask.x + width)
    depth = frame.depth[window][mask.pixels]
    optical = rays(frame.info)[window][mask.pixels].astype(np.float64) * depth[:, None]
    return _transform(frame.T_odom_optical, optical)


def _window(frame: RgbdImage, low: Array, high: Array) -> tuple[slice, slice]:
    """Return the rows and columns of the pixels whose centres are between two image points, clipped to the image."""
    height, width = frame.depth.shape
    x0, y0 = np.ceil(np.maximum(low, 0.0)).astype(int)
    x1, y1 = np.floor(np.minimum(high, (width - 1, height - 1))).astype(int)
    return slice(int(y0), int(y1) + 1), slice(int(x0), int(x1) + 1)


def _transform(T: Array, points: Array) -> Array:
    return points @ T[:3, :3].T + T[:3, 3]


@dataclass(frozen=True, slots=True)
class Box:
    """One box in an image.

    Attributes:
        label: class name.
        score: confidence, 0 to 1.
        corners: (4,) x_min, y_min, x_max, y_max [px].
    """

    label: str
    score: float
    corners: Array


def lift_boxes(frame: RgbdImage, boxes: Iterable[Box], config: LiftConfig) -> list[LocalizedObject]:
    """Return the boxes in space, best first; those outside the image, without an area or without depth are left out."""
    height, width = frame.depth.shape
    most = np.array([width - 1, height - 1, width - 1, height - 1], float)
    found: list[LocalizedObject] = []
    for box in sorted(boxes, key=lambda one: -one.score):
        corners = np.clip(np.asarray(box.corners, np.float64), 0.0, most)
        if not np.isfinite(corners).all() or (corners[2:] - corners[:2] < 1.0).any():
            continue
        lifted = lift(frame, Detection(box.label, box.score, corners, 0.5 * (corners[:2] + corners[2:])), config)
        if lifted is not None:
            found.append(lifted)
    return found


def standing_middle(points: Array, eye: Array) -> Array:
    """Return (2,) the middle of the plan of what stands upright and is about as deep as wide, such as a can [m].

    A camera shows the near side, and of what it looks down on the top, too. Half of the width behind the nearest point
    is the middle of both, unless more, or not as much, of the depth is seen.

    Args:
        points: (n, 3) what is seen of it, n >= 1, z up [m].
        eye: (2,) or (3,) where the camera is [m].
    """
    ahead = np.median(points[:, :2], axis=0) - eye[:2]
    ahead /= max(float(np.hypot(*ahead)), 1e-9)
    axes = np.array([ahead, (-ahead[1], ahead[0])])
    low, high = np.quantile(points[:, :2] @ axes.T, (0.02, 0.98), axis=0)
    deep, wide = high - low
    along = low[0] + min(max(0.5 * wide, 0.5 * deep), deep)
    return np.array([along, 0.5 * (low[1] + high[1])]) @ axes
