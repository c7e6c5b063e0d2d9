"""What a skill sees of things that stand on a surface: which to take, how high the surface is, what the palm shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from golem.capabilities.grasping.centroid import UP
from golem.capabilities.grasping.object_cloud import MIN_POINTS, bounds, fullest, piece_at, spaced
from golem.skills.base import StageFailed
from golem.skills.context import Context
from golem.types import Array, LocalizedObject, Side

LAYER = 0.006
"""Thickness of the layer of points that a surface is [m]: the noise of a head camera at arm's length."""
ABOUT = 0.16
"""Radius around a thing within which the surface is that it stands on [m]."""
TIPS = 0.004
"""Points of a palm camera that are less beyond the fingertips are the fingers' own [m]."""
PROUD = 0.012
"""Height above a surface from which on points are of what stands on it [m]."""
LEANS = 0.25
"""How far a level surface may seem to lean to a hand [rad]."""
WIDE = 0.10
"""Least width of a level plane that things may stand on [m]: the cap of a tall bottle is all that a hand above sees."""
HYPOTHESES = 400
"""Planes through three points that are tried."""
FINE = 0.005
"""Cells in which points of a palm camera hang together [m]: it is near, and things stand close to each other."""
STRAY = 8
"""Pieces that are looked at; some are too small to be a thing."""
ALIKE = 1.6
"""Factor by which a thing may be larger or smaller to a palm camera than to the head's."""
FRAMES = 3
"""Frames of a palm camera that are waited for, so that it shows the hand at rest."""


def surface_below(points: Array, place: Array, radius: float = ABOUT) -> float | None:
    """Return the height of the level surface around `place` (3,) or (2,), as `points` (n, 3) show it [m].

    The fullest layer of what is within `radius` [m]; None where too little is seen.
    """
    near = points[np.hypot(points[:, 0] - place[0], points[:, 1] - place[1]) < radius]
    if len(near) < MIN_POINTS:
        return None
    return fullest(near[:, 2], LAYER)


async def find(
    context: Context, label: str, near: tuple[float, float] | None, timeout: float
) -> LocalizedObject | None:
    """Return the thing of a class that the head camera shows within `timeout` [s]; None without one.

    It is the one nearest to where it is expected, `near`, x and y in odom [m]; None: the one that is told most surely.
    Raises StageFailed: the camera gave no detections.
    """
    with context.watch("head", label) as eye:
        end, seen = context.t + timeout, False
        while True:
            sightings = await eye.look(end - context.t)
            if sightings is None:
                break
            seen = True
            found = [o for o in sightings.objects if o.label == label]
            if found and near is None:
                return max(found, key=lambda o: o.detection.score)
            if found:
                return min(found, key=lambda o: float(np.hypot(*(o.position[:2] - np.array(near)))))
    if not seen:
        raise StageFailed("detect", "localizer", "The head camera gave no detections in time.")
    return None


async def palm_view(context: Context, side: Side, label: str, seconds: float) -> Array:
    """Return the (n, 3) points in odom that the palm camera shows beyond the fingertips [m]; n may be 0."""
    with context.watch(f"{side}_hand", label) as eye:
        end = context.t + seconds
        for _ in range(FRAMES):
            if await eye.look(end - context.t) is None:
                return np.zeros((0, 3))
    return beyond_fingers(context, side)


def beyond_fingers(context: Context, side: Side) -> Array:
    """Return the (n, 3) points in odom beyond the fingertips that the palm camera's newest frame shows [m]."""
    T, points = context.arms[side].pose, context.scene(f"{side}_hand")
    return points[(points - T[:3, 3]) @ T[:3, 2] > TIPS]


def seen_again(
    points: Array, target: LocalizedObject, trust: float, size: tuple[float, float] | None = None
) -> tuple[LocalizedObject, Array] | None:
    """Return `target` as a palm camera's `points` (n, 3) show it, and the (3,) normal of the surface it stands on.

    A hand whose encoders are off by degrees sees a level surface lean: its normal is what is upright to that hand.
    None where nothing like the thing is within `trust` [m]. Of what stands there the nearest is taken whose width and
    height are about those of `size` [m]; where nothing is so, or nobody says the size, the nearest.
    """
    middle = np.median(target.points, axis=0) if len(target.points) else target.position
    around = points[np.linalg.norm(points[:, :2] - middle[:2], axis=1) < trust + 0.10]
    if len(around) < MIN_POINTS:
        return None
    upright, surface = UP, leaning_surface(around)
    if surface is not None:
        upright = surface[0]
        around = around[around @ upright > surface[1] + PROUD]
    clouds = _pieces(around, middle, upright, trust)
    if not clouds:
        return None
    cloud = clouds[0]
    if size is not None and surface is not None:
        cloud = next((one for one in clouds if _alike(one, upright, surface[1], size)), cloud)
    centre = 0.5 * (cloud.min(axis=0) + cloud.max(axis=0))
    centre += (np.quantile(cloud @ upright, 0.9) - centre @ upright) * upright
    nearest = cloud[((cloud - centre) ** 2).sum(axis=1).argmin()].copy()
    return replace(target, position=nearest, points=cloud, mask=None), upright


def _pieces(around: Array, middle: Array, upright: Array, trust: float) -> list[Array]:
    """Return the clouds of what stands within `trust` [m] of `middle` (3,), the nearest first."""
    clouds: list[tuple[float, Array]] = []
    for _ in range(STRAY):
        if not len(around):
            break
        # Seen from above a bottle is a cap over a shoulder, with nothing between them: pieces are those of its plan.
        own = piece_at(around - np.outer((around - middle) @ upright, upright), middle, FINE)
        cloud, around = around[own], around[~own]
        away = float(np.hypot(*(np.median(cloud, axis=0) - middle)[:2]))
        if len(cloud) >= MIN_POINTS and away <= trust:
            clouds.append((away, cloud))
    return [cloud for _, cloud in sorted(clouds, key=lambda one: one[0])]


def width(points: Array) -> float:
    """Return the greater side of the plan of points (n, 3), strays left out [m]."""
    low, high = bounds(points[:, :2])
    return float((high - low).max())


def _alike(cloud: Array, upright: Array, surface: float, size: tuple[float, float]) -> bool:
    """Return whether a cloud on a plane at `surface` along `upright` is about as wide and high as `size`."""
    found = width(cloud), float(np.quantile(cloud @ upright, 0.98)) - surface
    return all(1.0 / ALIKE < have / expected < ALIKE for have, expected in zip(found, size, strict=True))


def leaning_surface(points: Array) -> tuple[Array, float] | None:
    """Return the largest nearly level plane in `points` (n, 3): its upward unit normal (3,), and its offset along it.

    Each cube of space counts once, however many pixels see it: a lid near to a camera has more than its table. None
    where too little is seen.
    """
    cubes = spaced(points, 0.008)
    if len(cubes) < MIN_POINTS:
        return None
    a, b, c = cubes[np.random.default_rng(0).integers(0, len(cubes), (3, HYPOTHESES))]
    normals = np.cross(b - a, c - a)
    normals *= np.sign(normals[:, 2:3])
    size = np.linalg.norm(normals, axis=1)
    kept = normals[:, 2] > np.cos(LEANS) * size
    normals, a = normals[kept] / np.maximum(size[kept, None], 1e-12), a[kept]
    if not len(normals):
        return None
    counts = (np.abs(cubes @ normals.T - np.einsum("ij,ij->i", a, normals)) < 0.5 * LAYER).sum(axis=0)
    best = int(counts.argmax())
    on = cubes[np.abs((cubes - a[best]) @ normals[best]) < 0.5 * LAYER]
    if len(on) < MIN_POINTS or width(on) < WIDE:
        return None
    middle = on.mean(axis=0)
    normal = np.linalg.svd(on - middle, full_matrices=False)[2][2]
    normal = normal if normal[2] > 0.0 else -normal
    return (normal, float(middle @ normal)) if normal[2] > np.cos(LEANS) else None
