"""Where every fastener of a pack is: the simulator's truth, for judges."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.worlds.layout import Kind

Where = Literal["seated", "lifted", "tray", "floor"]
FALLEN = 0.3
"""What is this far below the rim, which is deeper than the pack, has fallen down [m]."""

BESIDE = 0.005
"""What is this far beside the axis of its place is not in it [m]."""


@dataclass(frozen=True, slots=True)
class Whereabouts:
    """One fastener, and whether it was loosened.

    Attributes:
        where: `seated`: in its bore, on its stud; `lifted`: out of it, in a hand or on the pack; `tray`; `floor`.
        tray: name of the tray that it is in.
        right: whether that tray is for its kind; a bolt goes with the screws.
    """

    slot: int
    kind: Kind
    loose: bool
    where: Where = "seated"
    tray: str = ""
    right: bool = False


def whereabouts(robot: MujocoRobot) -> list[Whereabouts]:
    """Return where every fastener is that was there at the beginning, by its slot."""
    layout, names = robot.scene.layout, robot.scene.names
    draws = {draw.slot: (draw, mouth) for draw, mouth in zip(robot.scene.draws, names.mouths, strict=True)}
    half, height = 0.5 * np.array(layout.tray_size[:2]), layout.tray_size[2]
    trays = [(tray, np.linalg.inv(tray.pose())) for tray in layout.trays()]
    found: list[Whereabouts] = []
    for slot in range(len(layout.fasteners())):
        kind = layout.kind(slot)
        if slot not in draws:
            if slot not in layout.empty_holes:
                found.append(Whereabouts(slot, kind, loose=False))
            continue
        draw, mouth = draws[slot]
        at, axis = robot.data.body(draw.name).xpos, layout.pose()[:3, :3] @ draw.axis()
        along = float((at - mouth) @ axis)
        one = Whereabouts(slot, kind, True, "floor" if at[2] < layout.top_z - FALLEN else "lifted")
        if along <= draw.shank_length and np.linalg.norm(at - mouth - along * axis) < BESIDE:
            one = Whereabouts(slot, kind, loose=True)
        for tray, T in trays:
            x, y, z, _ = T @ (*at, 1.0)
            if (np.abs((x, y)) <= half).all() and -0.01 <= z <= height:
                right = tray.kind == ("nut" if kind == "nut" else "screw")
                one = Whereabouts(slot, kind, True, "tray", tray.name, right)
        found.append(one)
    return found


def counted(found: Sequence[Whereabouts]) -> dict[str, float]:
    """Return how many loosened fasteners of each kind are where, as `screw_tray`, and `KIND_right` of those."""
    loose = [one for one in found if one.loose]
    counts = Counter(f"{one.kind}_{one.where}" for one in loose)
    counts.update(f"{one.kind}_right" for one in loose if one.right)
    return {name: float(count) for name, count in sorted(counts.items())}
