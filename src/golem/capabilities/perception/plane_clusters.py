"""Handles and tableware by their shape: the large planes of a depth image go, what stands off them is told by its size.

Plane segmentation and Euclidean clustering (Rusu 2009), without any training: it knows five shapes, and no looks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from golem.capabilities.perception.lift import unproject
from golem.errors import unknown_name
from golem.robots.sensors.cameras import rays
from golem.types import Array, Detection, LocalizedObject, Mask, RgbdImage

SIZES: dict[str, tuple[float, float]] = {
    "mug": (0.100, 0.095),
    "bowl": (0.150, 0.065),
    "can": (0.066, 0.115),
    "bottle": (0.065, 0.230),
}
"""Width as seen and height of what is sold [m]: a mug of 11 oz, which counts its ear half, a bowl for cereals, a can of
0.33 l, a bottle of 0.5 l [assumption]. They are not the twin's."""
HANDLE = "handle"
LABELS = (HANDLE, *SIZES)
"""What it knows."""
SURE = 0.4
"""Length of a bar that is a handle for sure [m]."""
NEIGHBOURS = (
    (0, 1, 0.03), (1, 0, 0.03), (1, 1, 0.03), (1, -1, 0.03),
    (0, 2, 0.015), (2, 0, 0.015), (2, 2, 0.015), (2, -2, 0.015),
)  # fmt: skip
"""Rows down and columns right to pixels that belong to one piece, and the depth by which they may differ [m]."""


@dataclass(frozen=True, slots=True)
class PlaneClustersConfig:
    """Options of `PlaneClusters`.

    Attributes:
        stride: every how many pixels of rows and columns are looked at.
        thick: what is nearer than this to a plane is on it at 0.5 m [m]; it grows with the distance. Squared, as the
            noise of stereo grows, it hid every bowl from 1 m on.
        planes: how many planes are looked for at most.
        share: least share of the points that makes a plane.
        wide: least standard deviation of a plane's piece along its shorter side, as a share of its distance.
        hypotheses: planes through three points that are tried for each.
        least: pixels of a thing, counted at the stride.
        handle: bounds of an upright handle's length, width and distance from its door [m].
        alike: factor by which a thing may differ from the size of its kind; further ones are nothing.
        far: distance beyond which is not looked [m].
        seed: of the hypotheses.
        latency: declared time per frame [s].
    """

    stride: int = 2
    thick: float = 0.008
    planes: int = 5
    share: float = 0.03
    wide: float = 0.06
    hypotheses: int = 120
    least: int = 40
    handle: tuple[tuple[float, float], tuple[float, float], tuple[float, float]] = (
        (0.10, 1.2), (0.004, 0.06), (0.02, 0.12),
    )  # fmt: skip
    alike: float = 1.8
    far: float = 1.6
    seed: int = 0
    latency: float = 0.06


@dataclass(frozen=True, slots=True)
class _Plane:
    """A plane: points p of it have p @ normal = offset; the normal looks to the camera. In odom."""

    normal: Array
    offset: float

    def heights(self, points: Array) -> Array:
        return points @ self.normal - self.offset


class PlaneClusters:
    """Handles on doors, and mugs, bowls, cans and bottles on tables, by depth alone; see `Localizer`."""

    classes = LABELS

    def __init__(self, config: PlaneClustersConfig | None = None) -> None:
        self.config = config or PlaneClustersConfig()
        self.latency = self.config.latency

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        for label in labels:
            if label not in LABELS:
                raise unknown_name("label", label, LABELS)
        if not labels:
            return []
        c, s = self.config, self.config.stride
        depth = frame.depth[::s, ::s]
        valid = np.isfinite(depth) & (depth > 0.0) & (depth < c.far)
        if np.count_nonzero(valid) < 3 * c.least:
            return []
        optical = rays(frame.info)[::s, ::s][valid].astype(np.float64) * depth[valid][:, None]
        T = frame.T_odom_optical
        points = optical @ T[:3, :3].T + T[:3, 3]
        thick = c.thick * np.maximum(1.0, depth[valid] / 0.5)
        planes, free = self._planes(points, thick, T[:3, 3], valid)
        off = np.zeros(valid.shape, np.uint8)
        off[valid] = free
        index = np.full(valid.shape, -1)
        index[valid] = np.arange(len(points))
        found = [self._told(frame, pixels, points[index[pixels]], planes) for pixels in _pieces(off, depth, c.least)]
        return sorted(
            (one for one in found if one is not None and one.label in labels), key=lambda one: -one.detection.score
        )

    def _planes(
        self, points: Array, thick: Array, eye: Array, valid: NDArray[np.bool_]
    ) -> tuple[list[_Plane], NDArray[np.bool_]]:
        """Return the large planes, and which points (n,) are on none of them (RANSAC, greedy).

        Only what hangs together in the image and is wide is a plane: what else lies in it by chance is left.
        """
        c = self.config
        rng = np.random.default_rng(c.seed)
        planes: list[_Plane] = []
        left = np.ones(len(points), bool)
        for _ in range(c.planes):
            pool = np.flatnonzero(left)
            if len(pool) < max(c.share * len(points), 3):
                break
            some = rng.choice(pool, min(3000, len(pool)), replace=False)
            first = rng.choice(some, c.hypotheses)
            # Three points near each other in the image lie on one surface more often than any three.
            others = np.clip(first[:, None] + rng.integers(-4000, 4000, (c.hypotheses, 2)), 0, len(points) - 1)
            a, b, d = points[first], points[others[:, 0]], points[others[:, 1]]
            normals = np.cross(b - a, d - a)
            size = np.linalg.norm(normals, axis=1)
            sound = size > 1e-6
            normals, a = normals[sound] / size[sound, None], a[sound]
            if not len(a):
                continue
            offsets = np.einsum("ij,ij->i", a, normals)
            on = np.abs(points[some] @ normals.T - offsets) < thick[some][:, None]
            best = int(on.sum(axis=0).argmax())
            on = left & (np.abs(points @ normals[best] - offsets[best]) < thick)
            near = self._wide(on, points, valid, eye, c.wide)
            if not near.any():
                continue
            middle = points[near].mean(axis=0)
            cloud = points[near][:: max(1, int(near.sum()) // 2000)] - middle
            normal = np.linalg.svd(cloud, full_matrices=False)[2][2]
            normal = normal if (eye - middle) @ normal > 0 else -normal
            plane = _Plane(normal, float(middle @ normal))
            planes.append(plane)
            # What is cut off from a plane, by a bar before it, is narrow and still of it.
            on = left & (np.abs(plane.heights(points)) < 1.5 * thick)
            left &= ~near & ~self._wide(on, points, valid, eye, 0.0)
        return planes, left

    def _wide(
        self, near: NDArray[np.bool_], points: Array, valid: NDArray[np.bool_], eye: Array, wide: float
    ) -> NDArray[np.bool_]:
        """Return those of the points `near` (n,) whose piece of the image is large, and `wide` for its distance."""
        image = np.zeros(valid.shape, np.uint8)
        image[valid] = near
        count, numbers, stats, _ = cv2.connectedComponentsWithStats(image, connectivity=4)
        number = np.asarray(numbers)[valid].astype(np.int64)
        kept: NDArray[np.bool_] = np.zeros(count, bool)
        for k in range(1, count):
            if stats[k, cv2.CC_STAT_AREA] >= self.config.share * len(points):
                piece = points[number == k]
                piece = piece[:: max(1, len(piece) // 500)]
                spread = np.linalg.svd(piece - piece.mean(axis=0), compute_uv=False) / np.sqrt(len(piece))
                kept[k] = spread[1] > wide * np.linalg.norm(piece.mean(axis=0) - eye)
        return kept[number]

    def _told(
        self, frame: RgbdImage, pixels: tuple[NDArray[np.intp], NDArray[np.intp]], points: Array, planes: list[_Plane]
    ) -> LocalizedObject | None:
        """Return what a piece is, if it is anything."""
        length = self._bar(points, planes)
        label, score = (HANDLE, min(1.0, length / SURE)) if length else self._ware(points, planes)
        if label is None:
            return None
        s = self.config.stride
        rows, columns = pixels[0] * s, pixels[1] * s
        y0, y1, x0, x1 = rows.min(), rows.max() + 1, columns.min(), columns.max() + 1
        inside = np.zeros((y1 - y0, x1 - x0), bool)
        inside[rows - y0, columns - x0] = True
        mask = Mask(inside, int(x0), int(y0))
        cloud = unproject(frame, mask)
        box = np.array([x0, y0, x1 - 1, y1 - 1], float)
        detection = Detection(label, float(score), box, np.array([columns.mean(), rows.mean()]))
        nearest = cloud[((cloud - np.median(cloud, axis=0)) ** 2).sum(axis=1).argmin()]
        return LocalizedObject(detection, frame.t, nearest.copy(), cloud, mask)

    def _bar(self, points: Array, planes: list[_Plane]) -> float:
        """Return the length of a long thin upright piece a few centimetres before an upright plane; 0 of others [m]."""
        (short, long), (thin, wide), (near, away) = self.config.handle
        off = points - points.mean(axis=0)
        _, _, axes = np.linalg.svd(off[:: max(1, len(off) // 500)], full_matrices=False)
        along, across = off @ axes[0], off @ axes[1]
        length = float(np.quantile(along, 0.98) - np.quantile(along, 0.02))
        width = float(np.quantile(across, 0.9) - np.quantile(across, 0.1))
        if not (short <= length <= long and thin <= width <= wide and length > 3.5 * width):
            return 0.0
        if abs(axes[0, 2]) < 0.7:
            return 0.0
        before = (float(np.median(p.heights(points))) for p in planes if abs(p.normal[2]) < 0.3)
        return length if any(near < height < away for height in before) else 0.0

    def _ware(self, points: Array, planes: list[_Plane]) -> tuple[str | None, float]:
        """Return the kind of tableware whose size a piece on a level plane has, and how well, 0 to 1."""
        for plane in planes:
            if plane.normal[2] < 0.95:
                continue
            low, high = np.quantile(plane.heights(points), (0.02, 0.98)).tolist()
            # The foot of a thing may be hidden by another before it; what hangs in the air is none.
            if low > max(0.05, 0.5 * high) or high < 0.03:
                continue
            flat = points[:, :2] - points[:, :2].mean(axis=0)
            _, _, axes = np.linalg.svd(flat[:: max(1, len(flat) // 500)], full_matrices=False)
            spans = [float(np.ptp(np.quantile(flat @ axis, (0.02, 0.98)))) for axis in axes]
            # Of a thing seen from one side the far half is missing; the wider span is the honest one.
            wide = max(spans)
            away = {
                kind: float(np.hypot(np.log(wide / width), np.log(high / height)))
                for kind, (width, height) in SIZES.items()
            }
            kind = min(away, key=lambda name: away[name])
            if away[kind] < np.log(self.config.alike):
                return kind, float(np.exp(-2.0 * away[kind]))
        return None, 0.0


def _pieces(
    off: NDArray[np.uint8], depth: NDArray[np.float32], least: int
) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Return rows and columns of the connected pieces of `off` (h, w): neighbours of about the same depth are one."""
    rows, columns = np.nonzero(off)
    number = np.full(np.array(off.shape) + 4, -1)
    flat = np.full(number.shape, np.inf)
    number[2:-2, 2:-2][rows, columns] = np.arange(len(rows))
    flat[2:-2, 2:-2][rows, columns] = depth[rows, columns]
    pairs: list[NDArray[np.intp]] = []
    for down, right, step in NEIGHBOURS:
        at = rows + 2 + down, columns + 2 + right
        one = np.abs(flat[at] - depth[rows, columns]) < step
        pairs.append(np.stack([np.flatnonzero(one), number[at][one]]))
    first, second = np.concatenate(pairs, axis=1)
    graph = coo_array((np.ones(len(first), bool), (first, second)), shape=(len(rows), len(rows)))
    _, piece = connected_components(graph, directed=False)
    parts = np.split(np.argsort(piece, kind="stable"), np.cumsum(np.bincount(piece))[:-1])
    return [(rows[part], columns[part]) for part in parts if len(part) >= least]
