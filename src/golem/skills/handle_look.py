"""Where a handle really is, as the palm camera of the hand before it shows: looked at until the hand is before it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from golem.capabilities.grasping.base import Grasp
from golem.capabilities.planning.base import PlanRefused
from golem.skills.context import Context
from golem.skills.poses import moved, retracted
from golem.types import Array, LocalizedObject, Side

if TYPE_CHECKING:
    from golem.skills.open_door import OpenConfig
    from golem.skills.planned_motion import PlannedMotion

FRAMES = 4
"""Frames of the palm camera that tell where the handle is."""
UNSEEN = 1.0
"""Time without a handle in the palm camera's frames after which there is none to be seen from there [s]."""
VIEWS = ((0.0, 0.07), (0.06, 0.07), (-0.06, 0.07))
"""From how far along the closing axis, and how far back, a handle is looked for that is not seen [m]."""
LEVEL = 0.07
"""Height above and below the grasp within which the handle is looked at [m]."""
NEAR = 0.03
"""How far from where it is to look from a hand may arrive [m]."""


async def seen_before(
    context: Context, motion: PlannedMotion, config: OpenConfig, handle: LocalizedObject, grasp: Grasp, side: Side
) -> Grasp:
    """Return the grasp moved to where the palm camera sees the handle; as it is where it sees none.

    Camera and fingers sit on one hand: what the head camera's calibration and the joints are off by drops out. The hand
    is moved across the handle only: how much of its length each camera shows differs. A handle at the edge of the image
    is seen badly, so the hand goes before it and looks again. One that is not seen is looked for from further back and
    from both sides: behind a finger a bar is two short pieces, and at one edge of the image there is no depth.
    """
    context.say("approach", "Looking again with the palm camera.")
    for k in range(config.looks):
        seen, there = await _seen(context, config, handle, side), True
        if seen is None:
            context.say("approach", "The palm camera shows no handle. Looking from beside.")
            seen, there = await _searched(context, motion, config, handle, grasp, side), False
        off = np.zeros(3) if seen is None else np.append((seen - handle.position)[:2], 0.0)
        T = moved(grasp.T_odom_gripper, off)
        motion.displace(off)
        handle, grasp = replace(handle, position=handle.position + off), replace(grasp, T_odom_gripper=T)
        away = float(np.hypot(*off[:2]))
        if seen is not None:
            context.say("approach", f"The handle is {1e3 * away:.0f} mm from where it seemed.")
        if there and (away < config.centred or k == config.looks - 1):
            break
        try:
            await motion.to({side: retracted(T, config.before)}, config.travel_speed, near=NEAR)
        except PlanRefused:
            break
        if seen is None:
            break
    return grasp


async def _searched(
    context: Context, motion: PlannedMotion, config: OpenConfig, handle: LocalizedObject, grasp: Grasp, side: Side
) -> Array | None:
    """Return where (3,) the palm camera shows the handle from further back or from a side; None where it does not."""
    for across, back in VIEWS:
        view = retracted(grasp.T_odom_gripper, config.before + back)
        view = moved(view, across * view[:3, 1])
        try:
            await motion.to({side: view}, config.travel_speed, near=NEAR)
        except PlanRefused:
            continue
        seen = await _seen(context, config, handle, side)
        if seen is not None:
            return seen
    return None


async def _seen(context: Context, config: OpenConfig, handle: LocalizedObject, side: Side) -> Array | None:
    """Return where (3,) the palm camera shows the handle, about where it is expected; None where it shows none."""
    places: list[Array] = []
    with context.watch(f"{side}_hand", handle.label) as eye:
        end, since = context.t + config.look_timeout, context.t
        while len(places) < FRAMES and context.t < end and context.t < since + UNSEEN:
            sightings = await eye.look(end - context.t)
            seen = [] if sightings is None else [_nearest(o, handle.position) for o in sightings.objects]
            away = [float(np.linalg.norm((place - handle.position)[:2])) for place in seen]
            if seen and min(away) < config.trust:
                places.append(seen[int(np.argmin(away))])
                since = context.t
    return np.median(places, axis=0) if places else None


def _nearest(seen: LocalizedObject, position: Array) -> Array:
    """Return the middle of that part of `seen` (3,) that is at the height of `position`."""
    level = np.abs(seen.points[:, 2] - position[2]) < LEVEL
    return np.median(seen.points[level], axis=0) if level.any() else seen.position
