"""Where to stand before a counter, so that a hand gets to a place on it: by the counter's edge, as the LiDAR has it."""

from __future__ import annotations

import math

import numpy as np

from golem.capabilities.navigation.edge_fit import NearEdge
from golem.capabilities.navigation.goto import GoTo
from golem.skills.approach import APPROACH, approach
from golem.skills.context import Context
from golem.skills.pack_view import see_edge
from golem.types import Array, PlanarPose, Twist

STANDOFF = (0.35, 0.46)
"""Distances of base_link from the edge that belly and legs leave [m]."""
AHEAD = 0.50
"""Distance ahead at which the hands work best [m]."""
BESIDE = 0.16
"""How far beside the middle of the robot a place is best for a hand [m]."""
GOOD = (0.05, 0.12)
"""Distance and turn from the stance at which the robot may stay [m, rad]: a hand reaches that much further."""
SETTLE = 1.0
"""Time that the body gets to come to rest before it looks [s]."""
APPROACHES = 4
"""How often it is tried to come nearer."""
BACK = 0.35
"""How far it steps back from a counter before it walks elsewhere [m]: the arms come clear of what stands there."""
BLIND = 0.60
"""Distance from a place at which a robot stands that finds no edge [m]."""


async def stand_before(context: Context, place: Array) -> int:
    """Bring the robot before a place on a counter that is at most two metres away; returns how often it moved.

    Args:
        context: of the skill; its legs walk, and its stack listens to a LiDAR.
        place: (2,) or (3,) in odom [m].

    Raises:
        StageFailed: there is no edge, or no scan of it.
    """
    navigator, moved = GoTo(APPROACH), 0
    while True:
        context.legs.drive(Twist())
        await context.sleep(SETTLE)
        left = stance(await see_edge(context), PlanarPose.of(context.legs.pose), place)
        off = math.hypot(left.x, left.y)
        context.say("dock", f"{100 * off:.0f} cm and {math.degrees(left.yaw):.0f} deg from the stance.")
        if (off < GOOD[0] and abs(left.yaw) < GOOD[1]) or moved == APPROACHES:
            return moved
        await approach(context, navigator, PlanarPose.of(context.legs.pose) @ left)
        moved += 1


def stance(edge: NearEdge, here: PlanarPose, place: Array) -> PlanarPose:
    """Return where to stand, as seen from the robot.

    Args:
        edge: of the counter, as seen from the robot.
        here: where the robot is in odom.
        place: (2,) or (3,) what a hand is to get to, in odom [m].
    """
    local = here.to(PlanarPose(float(place[0]), float(place[1]), 0.0))
    across = edge.pose.to(local)
    standoff = float(np.clip(AHEAD - across.x, *STANDOFF))
    # On the side on which the robot is already: the hand of the other side is as good.
    now = edge.pose.to(PlanarPose(0.0, 0.0, 0.0))
    aside = float(np.clip(now.y - across.y, -BESIDE, BESIDE))
    return edge.pose @ PlanarPose(-standoff, across.y + aside, 0.0)


async def step_back(context: Context) -> None:
    """Step back from the counter, straight."""
    await approach(context, GoTo(APPROACH), PlanarPose.of(context.legs.pose) @ PlanarPose(-BACK, 0.0, 0.0))


def before(here: PlanarPose, place: Array, distance: float) -> PlanarPose:
    """Return the pose at `distance` [m] before `place` (2,) or (3,) that faces it, all in one frame with `here`."""
    yaw = math.atan2(float(place[1]) - here.y, float(place[0]) - here.x)
    return PlanarPose(
        float(place[0]) - distance * math.cos(yaw), float(place[1]) - distance * math.sin(yaw), yaw
    )
