"""Planning queries at varied packs: from where an arm waits or works to above a screw or the tray."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from golem.capabilities.arms.goal_postures import GoalPostures
from golem.capabilities.arms.postures import posture
from golem.capabilities.arms.solve import downward
from golem.capabilities.collision.obstacles import Obstacle, World
from golem.capabilities.planning.base import Held, PlanRequest
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.capabilities.planning.rules import HandUpright, Rule
from golem.robots.worlds.conditions import arranged, draw_conditions
from golem.robots.worlds.layout import PackLayout
from golem.skills.planned_motion import SCREW
from golem.types import Array, Side

PELVIS = 1.10
"""Height of base_link above the floor in the hoist [m]."""
YAW: dict[Side, float] = {"left": 0.5 * np.pi, "right": -0.5 * np.pi}
"""Heading of the gripper's x axis that suits an arm [rad]."""
UPRIGHT = np.deg2rad(45.0)
"""How far a hand that carries a screw may lean in a third of the queries [rad]."""


@dataclass(frozen=True, slots=True)
class Query:
    """What a planner is asked.

    Attributes:
        request: the request.
        kind: from where to where.
    """

    request: PlanRequest
    kind: str


def queries(robot: PlanningRobot, n: int, seed: int) -> Iterator[Query]:
    """Yield `n` queries whose start is free and that have a free goal posture; what else is drawn is left out.

    Args:
        robot: who is asked.
        n: how many.
        seed: the same draws the same.
    """
    finder, rng, count = GoalPostures(), np.random.default_rng(seed), 0
    while count < n:
        layout = arranged(PackLayout(), draw_conditions("varied", {}, rng))
        world = pack_world(layout, rng)
        side: Side = "left" if rng.random() < 0.5 else "right"
        places = {"screw": _above_screw(layout, side, rng), "tray": _above_tray(layout, side, rng)}
        kind = ("home to screw", "screw to tray", "tray to screw", "screw to home")[count % 4]
        one, other = kind.split(" to ")
        carries = kind == "screw to tray"
        held = (Held(side, SCREW),) if carries else ()
        rules: tuple[Rule, ...] = (HandUpright(side, UPRIGHT),) if carries and count % 3 == 0 else ()
        ends: list[Array] = []
        for name in (one, other):
            q = posture("home")
            space = JointSpace(robot, q, world, rules, held)
            if name == "home":
                found = q[None][[space.verdict(q) == 0]]
            else:
                T = (places[name], None) if side == "left" else (None, places[name])
                found = finder.find(*T, q, lambda a, s=space: s.verdict(a) == 0, seed=count)
            if not len(found):
                break
            ends.append(found[:1] if name == one else found)
        if len(ends) == 2:
            count += 1
            yield Query(PlanRequest(ends[0][0], ends[1], world, rules, held, seed=count), kind)


def pack_world(layout: PackLayout, rng: np.random.Generator) -> World:
    """Return pack, tray and what stands about as shapes in base_link.

    The cover counts as closed. Up to six boxes lie on it, and in half of the draws a post of 25 cm stands there.
    """
    top = layout.pose()
    shapes = [_box(top, (0.5 * layout.size_x, 0.0, -0.5 * layout.thickness),
                   (0.5 * layout.size_x, 0.5 * layout.size_y, 0.5 * layout.thickness), "pack")]  # fmt: skip
    x, y, z = (0.5 * s for s in layout.tray_size)
    wall, tray = 0.002, layout.tray_pose()
    shapes.append(_box(tray, (0.0, 0.0, wall), (x, y, wall), "tray"))
    for dx, dy, sx, sy in ((x, 0, wall, y), (-x, 0, wall, y), (0, y, x, wall), (0, -y, x, wall)):
        shapes.append(_box(tray, (dx, dy, z), (sx, sy, z), "tray"))
    for k in range(int(rng.integers(7)) + 1):
        tall = k == 0 and rng.random() < 0.5
        half = (0.03, 0.03, 0.125) if tall else tuple(rng.uniform(0.01, 0.04, 3).tolist())
        at = (float(rng.uniform(0.10, 0.5)), float(rng.uniform(-0.5, 0.5)), half[2])
        shapes.append(_box(top, at, half, "post" if tall else "clutter"))
    return World(shapes)


def _box(T_world: Array, at: tuple[float, ...], half: tuple[float, ...], name: str) -> Obstacle:
    T = T_world.copy()
    T[:3, 3] = (T_world @ (*at, 1.0))[:3]
    T[2, 3] -= PELVIS
    return Obstacle("box", T, tuple(float(h) for h in half), name)


def _above_screw(layout: PackLayout, side: Side, rng: np.random.Generator) -> Array:
    slots = layout.reachable()
    spot = layout.fasteners()[slots[int(rng.integers(len(slots)))]]
    x, y, z, _ = layout.pose() @ (*spot, 0.0, 1.0)
    return downward(float(x), float(y), float(z) - PELVIS + float(rng.uniform(0.04, 0.16)), YAW[side])


def _above_tray(layout: PackLayout, side: Side, rng: np.random.Generator) -> Array:
    x, y, z, _ = layout.tray_pose() @ (*rng.uniform(-0.04, 0.04, 2), 0.0, 1.0)
    return downward(float(x), float(y), float(z) - PELVIS + 0.10, YAW[side])
