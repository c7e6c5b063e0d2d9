"""What a hand's own camera adds before a grasp: where the thing really is, as seen from where the hand will come from.

Encoders, head camera and palm camera are off by centimetres together, and by how much changes with the arm's posture.
What a hand sees from straight before its grasp is off by what the last centimetres of the way add, and by no more.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from golem.capabilities.arms.reach_map import load_map
from golem.capabilities.grasping.base import Grasp
from golem.capabilities.grasping.centroid import UP, grasp_pose
from golem.capabilities.grasping.object_cloud import MIN_POINTS, bounds
from golem.capabilities.grasping.view_shift import View, shift_between
from golem.skills.context import Context
from golem.skills.planned_motion import PlannedMotion
from golem.skills.poses import moved, retracted
from golem.skills.take_config import TakeThingConfig
from golem.skills.ware_sight import PROUD, palm_view, seen_again, width
from golem.types import Array, LocalizedObject, Side

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
    """Brings one hand before a thing, and looks.

    Attributes:
        off: (2,) how far from where the head camera had it the thing was found, in odom [m].
    """

    def __init__(self, context: Context, motion: PlannedMotion, side: Side, config: TakeThingConfig) -> None:
        """Take distances and speeds from `config`."""
        self._context, self._motion, self._config = context, motion, config
        self._side: Side = side
        self.off: Array = np.zeros(2)

    async def at(
        self, target: LocalizedObject, way: Array, yaw: float
    ) -> tuple[LocalizedObject, Array, Array]:
        """Return the thing, the points (n, 3) around it, and the way (3,) to it as the palm camera shows them, in odom.

        It looks again from where it saw the thing, until that is where it was expected. The way keeps its angle to the
        surface as this hand sees it. Where the palm camera does not show the thing, all is what the head camera saw.

        Args:
            target: as the head camera saw it.
            way: (3,) direction along which the hand is to come.
            yaw: heading of its x axis [rad]; see `Gripper`.

        Raises:
            PlanRefused: the hand cannot be brought there.
        """
        c, context = self._config, self._context
        scene, seen_way = context.scene("head"), way
        size = _size(target.points)
        for k in range(c.looks):
            T = self._watching(target, way, yaw)
            await self._motion.to({self._side: T}, c.travel_speed, near=NEAR)
            palm = await palm_view(context, self._side, target.label, c.look_timeout)
            found = seen_again(palm, target, c.trust, size)
            if found is None:
                context.say("approach", f"The palm camera does not show the {target.label}.")
                break
            seen, upright = found
            off = (np.median(seen.points, axis=0) - np.median(target.points, axis=0))[:2]
            self._motion.displace(np.append(off, 0.0))
            # The head sees the front of a thing, a hand its top: the middle of both is nearer than their medians.
            self.off += (_middle(seen.points) - _middle(target.points))[:2]
            target, scene = seen, palm
            seen_way = Rotation.align_vectors(upright[None], UP[None])[0].apply(way)
            if math.hypot(*off) < c.centred or k == c.looks - 1:
                break
        if self.off.any():
            context.say("approach", f"It is {1e3 * math.hypot(*self.off):.0f} mm from where it seemed.")
        return target, scene, seen_way

    async def before(self, target: LocalizedObject, scene: Array, grasp: Grasp) -> tuple[Grasp, View]:
        """Return the grasp of a hand that is before it, and what it sees of the thing, on its way to it.

        It looks where it is, and nearer.

        Args:
            target: as the grasp was proposed on it.
            scene: (n, 3) points around it, from the same look.
            grasp: where the hand is about to go.

        Raises:
            PlanRefused: the hand cannot go on to it.
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

    Fingers centre a thing along the closing axis; a neck that is beside the pads across it turns out of them.

    Args:
        grasp: where the hand is about to go.
        points: (n, 3) of the thing as the palm camera shows it.
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


def _middle(points: Array) -> Array:
    """Return the middle (3,) of the bounds of points (n, 3), strays left out."""
    return bounds(points).mean(axis=0)
