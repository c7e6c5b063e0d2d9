"""What the robot does while its balance is judged: its arms move through the work area, its base follows a script."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from golem.interfaces import topics
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.types import SIDES, Array, PalmTargets, Side, Twist

CENTER: dict[Side, tuple[float, float, float]] = {"left": (0.43, 0.22, 0.20), "right": (0.43, -0.22, 0.20)}
"""Middle of each hand's work area in base_link [m]: the grasp frame of the posture `ready`."""
WORK_AREA = (0.08, 0.10, 0.12)
"""Half extents of the work area about its middle [m]."""
WIDE_AREA = (0.12, 0.14, 0.18)
"""Half extents of what the arms reach without changing their configuration [m]."""
FREQUENCIES = (0.08, 0.25)
"""Range of the frequencies a hand's motion is made of [Hz]; with `WORK_AREA` hands move at up to 0.3 m/s."""
BLEND = 2.0
"""Time in which the hands go from where they are into their motion [s]."""


class ArmMotion:
    """Smooth, seeded motion of both hands in base_link: two sines per axis, orientation as at the start."""

    def __init__(self, rng: np.random.Generator, extent: tuple[float, float, float] = WORK_AREA) -> None:
        """Draw frequencies and phases; hands stay within `extent` [m] of the middle of their work area."""
        self._extent = np.array(extent)
        self._frequency = rng.uniform(*FREQUENCIES, size=(2, 2, 3))
        self._phase = rng.uniform(0.0, 2.0 * np.pi, size=(2, 2, 3))

    def positions(self, t: float) -> Array:
        """Return the (2, 3) positions of the left and the right grasp frame in base_link at time `t` [s], in [m]."""
        waves = np.sin(2.0 * np.pi * self._frequency * t + self._phase)
        return np.array([CENTER[side] for side in SIDES]) + self._extent * waves.mean(axis=1)


class ScriptedMotion:
    """A routine that runs until it is cancelled; see `golem.skills.base.Routine`.

    Attributes:
        twist: what is commanded at time t [s] since the skill began; None commands nothing.
    """

    def __init__(self, arms: ArmMotion | None = None, twist: Callable[[float], Twist] | None = None) -> None:
        """Move the hands as `arms` says, None leaves them alone, and command `twist`."""
        self._arms = arms
        self.twist = twist

    async def run(self, context: Context, goal: None) -> SkillResult:
        """Move until cancelled."""
        start = context.t
        homes = [context.kinematics.pose(f"{side}_gripper") for side in SIDES]
        while True:
            elapsed = context.t - start
            if self._arms is not None:
                share = min(elapsed / BLEND, 1.0)
                share *= share * (3.0 - 2.0 * share)
                palms: list[Array] = []
                for home, position in zip(homes, self._arms.positions(elapsed), strict=True):
                    T = home.copy()
                    T[:3, 3] += share * (position - home[:3, 3])
                    # The hands move with the base: what is judged is the legs, not whether a hand keeps its place.
                    palms.append(context.T_odom_base @ T)
                context.publish(topics.PALM_TARGETS, PalmTargets(context.t, palms[0], palms[1]))
            if self.twist is not None:
                context.publish(topics.TWIST, self.twist(elapsed))
            await context.tick()
