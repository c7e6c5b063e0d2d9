"""Small modules that keep every promise, to break one of, and a skill."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from golem.errors import unknown_name
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.types import Detection, LocalizedObject, RgbdImage


class DarkSpots:
    """Two objects where the image is dark, in every frame that has depth there."""

    latency = 0.02

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        for label in labels:
            if label != "screw":
                raise unknown_name("label", label, ["screw"])
        rows, columns = np.nonzero((frame.rgb[..., 0] < 100) & (frame.depth > 0.1))
        if not labels or len(rows) < 2:
            return []
        found: list[LocalizedObject] = []
        for score, i in ((0.9, 0), (0.6, len(rows) - 1)):
            v, u, info = int(rows[i]), int(columns[i]), frame.info
            ray = np.array([(u - info.cx) / info.fx, (v - info.cy) / info.fy, 1.0, 0.0])
            p = frame.T_odom_optical @ (ray * float(frame.depth[v, u]) + (0, 0, 0, 1))
            box, center = np.array([u - 5.0, v - 5.0, u + 5.0, v + 5.0]), np.array([float(u), float(v)])
            found.append(LocalizedObject(Detection("screw", score, box, center), frame.t, p[:3], p[None, :3].copy()))
        return found


@dataclass(frozen=True)
class CountGoal:
    """How far to count.

    Attributes:
        to: the last number.
    """

    to: int = 5


class Counts:
    """Count slowly."""

    Goal = CountGoal

    def timeout(self, goal: CountGoal) -> float:
        return 10.0 + goal.to

    async def run(self, context: Context, goal: CountGoal) -> SkillResult:
        for i in range(goal.to):
            context.say("count", f"{i}")
            await context.sleep(0.5)
        return SkillResult(True, "done", None, "Counted.")
