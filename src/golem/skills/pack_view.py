"""What a standing robot sees of the pack: its near edge by the LiDAR, fasteners and tray by the head camera."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from golem.capabilities.grasping.object_cloud import height_above_ground
from golem.capabilities.navigation.edge_fit import NearEdge, near_edge, table_height
from golem.capabilities.planning.base import PlanRefused
from golem.interfaces import topics
from golem.middleware.bus import News
from golem.skills.base import StageFailed
from golem.skills.context import Context
from golem.skills.pick_targets import BESIDE, TORSO, names_of
from golem.skills.pick_targets import WANTED as NEAR
from golem.skills.planned_motion import PlannedMotion
from golem.skills.poses import counts_at, stands_at
from golem.skills.stance_choice import LOOK_TURN
from golem.types import Array, LocalizedObject, PlanarPose

LOOK = 1.2
"""Time over which scans are put together while the robot stands [s]."""
RIM = (-0.12, 0.02)
"""Heights from the top between which points are the pack's near side [m]."""
CAMERA = 2.5
"""Time that the head camera gets to show fasteners [s]."""
FRAMES = 3
"""Frames of it that are put together."""
SAME = 0.02
"""Distance within which two sightings are of one fastener [m]; real ones stand 24 mm apart."""
AVOIDED = 0.03
"""The same of a sighting and a place that is to be avoided, which another look told [m]."""
PROUD = 0.0115
"""Height above its ground from which on a fastener is wanted most [m]; that of `pick`."""
SPEED = 0.25
"""Speed of the hands meanwhile [m/s]."""
WANTED = (1.0, 0.3)
"""Weight of a fastener that stands proud, or of which that is not known, and of one that is screwed down [own]."""


@dataclass(frozen=True, slots=True)
class SeenFasteners:
    """What the head camera shows.

    Attributes:
        places: (n, 3) fasteners in base_link [m].
        weights: (n,) how much each is wanted.
        tray: (3,) the container in base_link [m]; None where it was not seen.
    """

    places: Array
    weights: Array
    tray: Array | None


async def see_edge(context: Context) -> NearEdge:
    """Return the near edge of the pack, in base_link. The robot has to stand still.

    Raises StageFailed: there is none, or no scan.
    """
    news, points, heights = News(context.bus, topics.SCAN), list[Array](), list[Array]()
    end = context.t + LOOK
    while context.t < end:
        await context.tick()
        scan = news.read()
        if scan is not None:
            points.append(scan.points[:, :2])
            heights.append(scan.heights)
    if not points:
        raise StageFailed("look", "robot", "No scan comes: docking needs a LiDAR, and an odometry that goes by it.")
    T = PlanarPose.of(context.legs.pose).matrix()
    local = (np.concatenate(points) - T[:2, 3]) @ T[:2, :2]
    height = np.concatenate(heights)
    top = table_height(local, height)
    if top is None:
        raise StageFailed("look", "dock", "Nothing like a table is ahead.")
    side = (height > top + RIM[0]) & (height < top + RIM[1])
    edge = near_edge(local[side], PlanarPose(0.0, 0.0, 0.0))
    if isinstance(edge, str):
        raise StageFailed("look", "dock", edge)
    return replace(edge, height=top)


NOTHING: Array = np.zeros((0, 2))
"""No places on the floor."""


async def see_fasteners(
    context: Context, label: str, container: str, avoid: Array, around: bool, wanted: Array = NOTHING,
    container_at: Array = NOTHING,
) -> SeenFasteners:  # fmt: skip
    """Return what the head camera shows of fasteners and container; nothing where no frame comes.

    Args:
        avoid: (n, 2) in odom, of fasteners that are left out [m].
        around: whether the torso turns to either side where fasteners are in view and no container is.
        wanted: (n, 2) in odom, of the only fasteners that count [m]; without any, all do.
        container_at: (n, 2) in odom, of the only containers that count [m]; likewise.
    """
    seen: list[tuple[Array, list[float]]] = []
    trays: list[tuple[float, Array]] = []
    marks = avoid, wanted, container_at
    await _look(context, label, container, marks, seen, trays)
    if around and seen and not trays:
        motion, ahead = PlannedMotion(context), context.commanded_joints.copy()
        for turn in (LOOK_TURN, -LOOK_TURN):
            turned = ahead.copy()
            turned[TORSO] += turn
            with suppress(PlanRefused):
                await motion.to_joints(turned, (), SPEED)
                await _look(context, label, container, marks, seen, trays)
            if trays:
                break
        with suppress(PlanRefused):
            await motion.to_joints(ahead, (), SPEED)
    tray = max(trays, key=lambda one: one[0])[1] if trays else None
    places = np.array([place for place, _ in seen]).reshape(-1, 3)
    return SeenFasteners(places, np.array([float(np.mean(w)) for _, w in seen]), tray)


async def _look(
    context: Context,
    label: str,
    container: str,
    marks: tuple[Array, Array, Array],
    seen: list[tuple[Array, list[float]]],
    trays: list[tuple[float, Array]],
) -> None:
    """Add what the head camera shows in some frames to `seen` and `trays`, in base_link."""
    avoid, wanted, container_at = marks
    names = names_of(label, wanted)
    with context.watch("head", *names, container, doubtful=(container,)) as eye:
        end, frames = context.t + CAMERA, 0
        while frames < FRAMES and (sightings := await eye.look(end - context.t)) is not None:
            frames += 1
            T = context.T_odom_base
            for o in sightings.objects:
                place = T[:3, :3].T @ (o.position - T[:3, 3])
                if o.label == container:
                    if counts_at(o.position, container_at, BESIDE):
                        trays.append((float(o.detection.score), place))
                elif o.label not in names or stands_at(o.position, avoid, AVOIDED):
                    continue
                elif counts_at(o.position, wanted, NEAR):
                    _add(seen, place, _weight(o))


def _weight(o: LocalizedObject) -> float:
    height = height_above_ground(o)
    return WANTED[0] if height is None or height >= PROUD else WANTED[1]


def _add(seen: list[tuple[Array, list[float]]], place: Array, weight: float) -> None:
    """Add one sighting to those of the same fastener, or as a new one."""
    for known, weights in seen:
        if np.hypot(*(known - place)[:2]) < SAME:
            weights.append(weight)
            return
    seen.append((place, [weight]))


def fit_frames(a: Array, b: Array) -> tuple[PlanarPose, float]:
    """Return where the frame of `a` is in that of `b`, and the RMS distance that is left [m].

    Least squares over turn and shift, as Kabsch (Acta Cryst. A32, 1976), for frames whose z axes are parallel.

    Args:
        a: (n, 2) places, n >= 1; of one alone follows no turn [m].
        b: (n, 2) the same in the other frame [m].
    """
    mid_a, mid_b = a.mean(axis=0), b.mean(axis=0)
    p, q = a - mid_a, b - mid_b
    turn = math.atan2(float(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])), float(np.sum(p * q)))
    R = PlanarPose(0.0, 0.0, turn).matrix()[:2, :2]
    left = a @ R.T + (mid_b - R @ mid_a) - b
    x, y = (mid_b - R @ mid_a).tolist()
    return PlanarPose(x, y, turn), float(np.sqrt(np.mean(np.sum(left**2, axis=1))))


def matched(known: Array, seen: Array, within: float) -> tuple[Array, Array]:
    """Return the pairs (k, d), (k, d) of `known` (n, d) and `seen` (m, d) places that are nearest in x and y."""
    if not len(known) or not len(seen):
        return known[:0], seen[:0]
    away = np.linalg.norm(known[:, None, :2] - seen[None, :, :2], axis=2)
    mine, other = away.argmin(axis=0), away.argmin(axis=1)
    good = [k for k in range(len(seen)) if other[mine[k]] == k and away[mine[k], k] < within]
    return known[mine[good]], seen[good]


STIFF = 0.05
"""Spread of places from which on a new slope is believed, in sums of squares [m^2]: a row tells none across it."""
ROUGH, ROUNDS = 0.005, 8
"""Heights this near to the rim count fully [m], those of mistaken neighbours on another level hardly, after so many
rounds."""


@dataclass(frozen=True, slots=True)
class SeenRim:
    """How high a head camera shows the rim of a pack: one that looks aside shows it slope.

    Attributes:
        height: in the middle of what was seen [m].
        middle: (2,) that middle in the pack frame [m].
        slope: (2,) metres per metre along x and y.
    """

    height: float = 0.0
    middle: Array = field(default_factory=lambda: np.zeros(2))
    slope: Array = field(default_factory=lambda: np.zeros(2))

    def seen(self, places: Array, heights: Array) -> SeenRim:
        """Return the rim whose `heights` (n,) [m] were seen at (n, 2) `places` in the pack frame [m], n >= 1.

        Few places leave the slope as it was. The fit is one of absolute values, by weights.
        """
        height, middle, slope = float(np.median(heights)), places.mean(axis=0), self.slope
        off = places - middle
        for _ in range(ROUNDS):
            left = heights - height - off @ slope
            weights = ROUGH / np.maximum(np.abs(left), ROUGH)
            height += float(weights @ left / weights.sum())
            left, spread = heights - height - off @ self.slope, off.T * weights
            slope = self.slope + np.linalg.solve(spread @ off + np.eye(2) * STIFF, spread @ left)
        return SeenRim(height, middle, slope)

    def at(self, place: Array) -> float:
        """Return the height at (2,) or (3,) `place` [m]."""
        return self.height + float((place[:2] - self.middle) @ self.slope)
