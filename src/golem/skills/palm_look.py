"""What a hand's own camera adds before a grasp: where the thing really is, as seen from where the hand will come from.

Encoders, head camera and palm camera are off by centimetres together, and by how much changes with the arm's posture.
What a hand sees from straight before its grasp is off by what the last centimetres of the way add, and by no more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from golem.capabilities.arms.reach_map import load_map
from golem.capabilities.grasping.base import Grasp
from golem.capabilities.grasping.centroid import ACROSS, UP, grasp_pose
from golem.capabilities.grasping.object_cloud import MIN_POINTS, PIXEL, across, bounds
from golem.capabilities.perception.lift import standing_middle
from golem.skills.context import Context
from golem.skills.planned_motion import PlannedMotion
from golem.skills.poses import moved, retracted
from golem.skills.take_config import TakeThingConfig
from golem.skills.ware_sight import PROUD, palm_view, seen_again, width
from golem.types import Array, LocalizedObject, Side

TOP = 0.015
"""Height of the layer that is the top of a thing [m]."""
CAP = 0.05
"""Width up to which a top is small enough to be seen whole [m]: a bottle's cap and neck, unlike its shoulder."""
SEARCH = 0.06
"""How far a thing may have moved between two looks [m]."""


@dataclass(frozen=True, slots=True)
class View:
    """What a camera showed: the `thing` (n, 3), and all points `around` (m, 3) with it, in one frame [m]."""

    thing: Array
    around: Array


def shift_between(before: View, after: View, axis: Array) -> Array:
    """Return by how much (3,) a thing has moved from one view to another [m], both along about `axis` (3,).

    Across the axis, it is the shift at which the silhouettes differ in the fewest pixels; pixels of which one view
    knows nothing do not count. Of what has a small top it is that of the top: from one place a camera shows a bottle's
    cap alone, from another its shoulder, too. Along the axis, it is how much nearer or farther what both show is.
    """
    flat = np.column_stack(across(axis))
    if axis[2] < -ACROSS:
        caps = [bounds(top_of(view.thing)) for view in (before, after)]
        if all((high - low)[:2].max() < CAP for low, high in caps):
            aside = flat @ flat.T @ (caps[1].mean(axis=0) - caps[0].mean(axis=0))
            return aside + _farther(before.thing + aside, after.thing, flat, axis) * axis
    return _laid_over(before, after, flat, axis)


def top_of(points: Array) -> Array:
    """Return the highest of points (n, 3)."""
    return points[points[:, 2] > np.quantile(points[:, 2], 0.98) - TOP]


def _laid_over(before: View, after: View, flat: Array, axis: Array) -> Array:
    """Return the shift by silhouettes along `axis` (3,), whose axes are `flat` (3, 2); see `shift_between`."""
    low = np.minimum((before.thing @ flat).min(axis=0), (after.thing @ flat).min(axis=0)) - SEARCH
    high = np.maximum((before.thing @ flat).max(axis=0), (after.thing @ flat).max(axis=0)) + SEARCH
    size, edge = np.ceil((high - low) / PIXEL).astype(int) + 1, round(SEARCH / PIXEL)
    (one, known), (two, seen) = (_silhouette(view, flat, low, size) for view in (before, after))
    two, seen = (np.pad(image, edge) for image in (two, seen))

    def overlap(image: NDArray[np.float32], template: NDArray[np.float32]) -> Array:
        return np.asarray(cv2.matchTemplate(image, template, cv2.TM_CCORR), np.float64)

    shared = overlap(seen, known)
    differ = overlap(seen - two, one) + overlap(two, known - one)
    differ = np.where(shared > 0.5 * shared.max(), differ / np.maximum(shared, 1.0), np.inf)
    i, j = np.unravel_index(int(differ.argmin()), differ.shape)
    best = np.array([i + _vertex(differ[:, j], int(i)), j + _vertex(differ[i], int(j))]) - edge
    aside = flat @ (best * PIXEL)
    return aside + _farther(before.thing + aside, after.thing, flat, axis) * axis


def _farther(before: Array, after: Array, flat: Array, axis: Array) -> float:
    """Return how much farther along `axis` (3,) a thing is after than before [m], where both views show it.

    Both are points (n, 3) of it, across the axis in the same place; a hand above a rim shows the other side of a bowl.
    Of what is seen from above the top counts: where one view has the bottom of a mug, the other has its wall before it.
    """
    if axis[2] < -ACROSS:
        before, after = top_of(before), top_of(after)
    views = before @ flat, after @ flat
    both = np.concatenate(views)
    low = both.min(axis=0)
    size = np.ceil((both.max(axis=0) - low) / PIXEL).astype(int)
    layers = np.full((2, *(size + 2)), np.inf)
    for layer, spots, points in zip(layers, views, (before, after), strict=True):
        np.minimum.at(layer, tuple(np.round((spots - low) / PIXEL).astype(int).T), points @ axis)
    shared = np.isfinite(layers).all(axis=0)
    if shared.sum() < MIN_POINTS:
        return float(np.quantile(after @ axis, 0.1) - np.quantile(before @ axis, 0.1))
    return float(np.median(layers[1][shared] - layers[0][shared]))


def _vertex(values: Array, k: int) -> float:
    """Return how far from the least value, the `k`-th, the parabola through it and its neighbours is least."""
    if not 0 < k < len(values) - 1 or not np.isfinite(values[k - 1 : k + 2]).all():
        return 0.0
    a, b, c = (float(v) for v in values[k - 1 : k + 2])
    return 0.5 * (a - c) / max(a - 2.0 * b + c, 1e-6)


def _silhouette(
    view: View, flat: Array, low: Array, size: NDArray[np.intp]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return two images of `size` pixels from `low` (2,) on: where the thing is, and what the camera has in view."""
    thing, seen = np.zeros(tuple(size), np.uint8), np.zeros(tuple(size), np.uint8)
    pixels = np.round((view.thing @ flat - low) / PIXEL).astype(int)
    thing[tuple(pixels[((pixels >= 0) & (pixels < size)).all(axis=1)].T)] = 1
    closed = np.asarray(cv2.morphologyEx(thing, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8)), np.float32)
    # What the thing hides is in view, too: it is not the thing.
    around = np.round((np.concatenate([view.around, view.thing]) @ flat - low) / PIXEL).astype(np.int32)
    cv2.fillConvexPoly(seen, cv2.convexHull(around[:, ::-1]), 1)
    return closed * seen, seen.astype(np.float32)


NEAR = 0.03
"""How far from where the palm camera is to look from a hand may arrive [m]."""
COMFORT: Array = np.array([0.45, -0.15, 0.0])
"""Where the right hand works best, in base_link [m]; its height does not count."""
LEAVE = (0.010, math.radians(3.0))
"""How far a hand may leave its line to the grasp, and turn [m, rad]: it looks again."""
CLEAR = 0.015
"""Distance of the fingertips from the thing at the last look [m]."""
NEARER = 0.03
"""How much nearer than before the last look has to be [m]."""
STRAYED = 0.03
"""How far the hand may have left its line between two looks [m]; more is a mistake of the eye."""
NECK = 0.05
"""Width up to which what is between the fingers is held in its middle [m]: pads are 16 mm wide."""
FINGERS = 0.08
"""How far above the fingertips that is looked for [m]."""
LAST = 0.06
"""How far from where it is expected the thing may be seen by a hand that is before its grasp [m]."""


class PalmLook:
    """Brings one hand before a thing, and looks; it was `off` (2,) from where the head saw it, in odom [m]."""

    def __init__(self, context: Context, motion: PlannedMotion, side: Side, config: TakeThingConfig) -> None:
        self._context, self._motion, self._config = context, motion, config
        self._side: Side = side
        self.off: Array = np.zeros(2)

    async def at(self, target: LocalizedObject, way: Array, yaw: float) -> tuple[LocalizedObject, Array, Array]:
        """Return the thing, the points (n, 3) around it, and the way (3,) to it as the palm camera shows them, in odom.

        It looks again from where it saw the thing, until that is where it was expected. The way keeps its angle to the
        surface as this hand sees it. Where the palm camera does not show the thing, all is what the head camera saw.
        Raises PlanRefused: the hand cannot be brought there.

        Args:
            target: as the head camera saw it.
            way: (3,) direction along which the hand is to come.
            yaw: heading of its x axis [rad]; see `Gripper`.
        """
        c, context = self._config, self._context
        scene, seen_way = context.scene("head"), way
        if not len(target.points):
            target = replace(target, points=target.position[None], mask=None)
        size, eye = _size(target.points), context.T_odom_base[:2, 3]
        for k in range(c.looks):
            await self._motion.to({self._side: self._watching(target, way, yaw)}, c.travel_speed, near=NEAR)
            palm = await palm_view(context, self._side, target.label, c.look_timeout)
            found = seen_again(palm, target, c.trust, size)
            if found is None:
                context.say("approach", f"The palm camera does not show the {target.label}.")
                break
            seen, upright = found
            off = (np.median(seen.points, axis=0) - np.median(target.points, axis=0))[:2]
            self._motion.displace(np.append(off, 0.0))
            # The head sees the front of a thing, a hand its top: their middles are the same, their medians are not.
            hand = context.arms[self._side].pose[:2, 3]
            self.off += standing_middle(seen.points, hand) - standing_middle(target.points, eye)
            eye = hand
            target, scene = seen, palm
            seen_way = Rotation.align_vectors(upright[None], UP[None])[0].apply(way)
            if math.hypot(*off) < c.centred or k == c.looks - 1:
                break
        if self.off.any():
            context.say("approach", f"It is {1e3 * math.hypot(*self.off):.0f} mm from where it seemed.")
        return target, scene, seen_way

    async def before(self, target: LocalizedObject, scene: Array, grasp: Grasp) -> tuple[Grasp, View]:
        """Return the grasp of a hand that is before it, and what it sees of the thing, on its way to it.

        It looks where it is, and nearer; `scene` (n, 3) are points around the thing from the same look [m].
        Raises PlanRefused: the hand cannot go on to it.
        """
        c, view = self._config, View(target.points, scene)
        axis = grasp.T_odom_gripper[:3, 2]
        for k, rest in enumerate((c.before, self._rest(target, grasp))):
            if k and rest > c.before - NEARER:
                break
            if k:
                await self._motion.line(
                    self._side, retracted(grasp.T_odom_gripper, rest), c.reach_speed, tolerance=LEAVE
                )
            glances = [one for _ in range(c.glances if k else 1) if (one := await self._seen(target))]
            if not glances:
                break
            seen, shifts = glances[-1], [shift_between(view, seen, axis) for seen in glances]
            # A base that sways is taken in its middle.
            shift = 0.5 * (np.min(shifts, axis=0) + np.max(shifts, axis=0))
            if k and float(np.linalg.norm(shift)) > STRAYED:
                break
            view, grasp = seen, replace(grasp, T_odom_gripper=moved(grasp.T_odom_gripper, shift))
            target = replace(target, position=np.median(seen.thing, axis=0), points=seen.thing)
            self._context.say("approach", f"The grasp moves by {1e3 * float(np.linalg.norm(shift)):.0f} mm.")
        return centred(grasp, view.thing), view

    async def _seen(self, target: LocalizedObject) -> View | None:
        """Return what the palm camera shows of the thing now; None where it is not where it is expected."""
        c, context = self._config, self._context
        await context.arms[self._side].settle(c.tolerance, 1.0)
        palm = await palm_view(context, self._side, target.label, c.look_timeout)
        found = seen_again(palm, target, LAST)
        return None if found is None else View(found[0].points, palm)

    def _rest(self, target: LocalizedObject, grasp: Grasp) -> float:
        """Return how far before the grasp the fingertips are just before the thing [m]."""
        T = grasp.T_odom_gripper
        return float(-np.quantile((target.points - T[:3, 3]) @ T[:3, 2], 0.02)) + CLEAR

    def _watching(self, target: LocalizedObject, way: Array, yaw: float) -> Array:
        """Return the (4, 4) pose in odom from which the palm camera shows the thing, wherever it is about there.

        A hand that looks down stays within its reach: the head camera may show the thing a little beyond it.
        """
        points = target.points if len(target.points) else target.position[None]
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        if way[2] > -0.9:
            return grasp_pose(middle - self._config.watch * way, yaw, -way)
        middle[2] = points[:, 2].max() + self._config.watch
        T = self._context.T_odom_base
        local = T[:3, :3].T @ (middle - T[:3, 3])
        mirror = np.array([1.0, 1.0 if self._side == "right" else -1.0, 1.0])
        best, reach = COMFORT * mirror + (0.0, 0.0, local[2]), load_map()
        shares = np.linspace(0.0, 1.0, 11)
        there = next((s for s in shares if reach.serves(self._side, local + s * (best - local))), 1.0)
        return grasp_pose(T[:3, :3] @ (local + there * (best - local)) + T[:3, 3], yaw, -way)


def centred(grasp: Grasp, points: Array) -> Grasp:
    """Return a grasp with the middle of what is between its fingers in the middle of the pads, if that is narrow.

    Fingers centre a thing along the closing axis; a neck that is beside the pads across it turns out of them. The palm
    camera shows the thing as `points` (n, 3) [m].
    """
    T = grasp.T_odom_gripper
    local = (points - T[:3, 3]) @ T[:3, :3]
    between = (np.abs(local[:, 1]) < 0.5 * grasp.gap) & (local[:, 2] < 0.0) & (local[:, 2] > -FINGERS)
    if between.sum() < MIN_POINTS:
        return grasp
    low, high = np.quantile(local[between, 0], (0.02, 0.98))
    if high - low > NECK:
        return grasp
    return replace(grasp, T_odom_gripper=moved(T, 0.5 * (low + high) * T[:3, 0]))


def _size(points: Array) -> tuple[float, float] | None:
    """Return width and height of what stands on a surface, as the head camera's points (n, 3) of it show them [m]."""
    if len(points) < MIN_POINTS:
        return None
    low, high = np.quantile(points[:, 2], (0.02, 0.98))
    return width(points), float(high - low) + PROUD
