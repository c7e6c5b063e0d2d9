"""Docking: the robot puts its feet where its hands can work, by the pack's near edge and the fasteners it sees."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from golem.capabilities.navigation.base import NavInputs
from golem.capabilities.navigation.edge_fit import NearEdge
from golem.capabilities.navigation.goto import GoTo, GoToConfig
from golem.errors import ConfigError
from golem.options import require
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.pack_view import CAMERA, LOOK, see_edge, see_fasteners
from golem.skills.pose_goal import FIRST_REPORT, MARGIN
from golem.skills.poses import floor_places
from golem.skills.stance_choice import GOOD, PackStance, best_stance, stance_here
from golem.types import Array, PlanarPose, Twist

TIMEOUT = 30.0
"""Time that one approach may take [s]."""
APPROACH = GoToConfig(speed=(0.2, 0.15, 0.3), face=5.0)
"""Slow, and always facing as it will stand."""
STEPS = replace(APPROACH, accept=0.05, straight=0.06, settle=1.0, rest=0.3)
"""The same for who sees after each stop, better than the odometry does, by how much it missed."""


async def approach(context: Context, navigator: GoTo, target: PlanarPose) -> None:
    """Go straight to `target`, a pose of base_link in the odometry's frame, and stand, there or after `TIMEOUT`.

    The `navigator` learns with every approach how these legs stop. Raises StageFailed: the odometry has fallen silent;
    the robot stands.
    """
    context.release_arms()  # none is drawn to where it was
    navigator.start(target)
    end = context.t + TIMEOUT
    try:
        while context.t < end:
            await context.tick()
            status = context.legs.status
            pose = PlanarPose.of(context.legs.pose) @ status.rest
            step = navigator.step(NavInputs(pose, status.moving), context.period)
            context.legs.drive(step.twist)
            if step.arrived:
                return
    finally:
        context.legs.drive(Twist())


SETTLE = 1.0
"""Time that the body gets to come to rest before it looks [s]."""
FARTHEST = 1.8
"""Longest way to the stance [m]: more is a way for `navigate`."""
IN_VIEW = 0.35
"""Distance from the stance by the edge from which on the head camera is asked for fasteners [m]."""
GAIN = 0.05
"""Quality that an approach has to win for another one to be tried."""
NOTHING = 0.02
"""Quality of a stance from which no hand gets anywhere."""


@dataclass(frozen=True, slots=True)
class DockGoal:
    """Where to stand.

    Attributes:
        stance: `reach`: where the hands get to the fasteners that are seen, and to the container; `edge`: as
            `standoff` and `lateral` say, which also hold as long as no fastener is seen.
        standoff: distance from base_link to the edge [m].
        lateral: where along the edge, from its middle, to the left [m]; None: where it comes from.
        tolerance: distance from the stance that is good enough [m]: a stop moves the robot by more than 1 cm.
        turned: the same of the heading [rad].
        approaches: how often it is tried.
        label, container: classes of the fasteners and of where they are put.
        avoid: x, y in odom of fasteners that are not wanted any more, one after the other [m].
        wanted: x, y in odom of the only fasteners that are wanted, likewise; none: all.
    """

    stance: Literal["reach", "edge"] = "reach"
    standoff: float = 0.42
    lateral: float | None = 0.0
    tolerance: float = 0.03
    turned: float = 0.05
    approaches: int = 4
    label: str = "screw"
    container: str = "tray"
    avoid: tuple[float, ...] = ()
    wanted: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        near, angle = "a positive distance of at most 0.2 m", "a positive angle of at most 0.5 rad"
        require(
            "goal of docking: ",
            ("standoff", self.standoff, 0.3 <= self.standoff <= 1.5, "from 0.3 to 1.5 m"),
            ("lateral", self.lateral or 0.0, abs(self.lateral or 0.0) <= 1.0, "at most 1 m to either side"),
            ("tolerance", self.tolerance, 0.0 < self.tolerance <= 0.2, near),
            ("turned", self.turned, 0.0 < self.turned <= 0.5, angle),
            ("approaches", self.approaches, 1 <= self.approaches <= 10, "from 1 to 10"),
        )
        for places in (self.avoid, self.wanted):
            floor_places("docking", places)
        if not (self.label and self.container):
            raise ConfigError("Docking names the class of the fasteners and that of their container.")


@dataclass
class DockReport:
    """How the robot stands.

    Attributes:
        left: x, y [m] and yaw [rad] of the stance as seen from the robot.
        quality: how far within reach fasteners and container are, 0 to 1; 0 where none was seen.
        served: fasteners within reach.
        approaches: how often it moved.
    """

    left: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quality: float = 0.0
    served: int = 0
    approaches: int = 0


@dataclass(frozen=True, slots=True)
class _View:
    """What one look says: the stance (as seen from the robot), and the near edge.

    Where some fastener was seen also how the robot stands `here`, and how it could at `best`.
    """

    left: PlanarPose
    edge: NearEdge
    here: PackStance | None = None
    best: PackStance | None = None

    @property
    def distance(self) -> float:
        """Length of the way to the stance [m]."""
        return math.hypot(self.left.x, self.left.y)


class Dock:
    """Stand before the pack where the hands can work: look, approach with small steps, settle, look again.

    Stages (see `Skill`): `look`, `approach`, `done`. It ends when the stance is good enough, when an approach has won
    nothing, or after those of the goal. Where some fastener is within reach it has succeeded.
    """

    Goal, Result = DockGoal, DockReport

    def __init__(self) -> None:
        self._tray: Array | None = None
        """(3,) where it was seen last, in the odometry's frame [m]."""

    def timeout(self, goal: DockGoal) -> float:
        return (goal.approaches + 1) * (TIMEOUT + SETTLE + LOOK + CAMERA + 2.0) + MARGIN

    async def run(self, context: Context, goal: DockGoal) -> SkillResult:
        try:
            return await self._dock(context, goal)
        except StageFailed as failure:
            context.legs.drive(Twist())
            context.say(failure.stage, str(failure), failed=True)
            return SkillResult(False, failure.stage, failure.slot, str(failure), value=DockReport())

    async def _dock(self, context: Context, goal: DockGoal) -> SkillResult:
        start, navigator = context.t, GoTo(APPROACH)
        await context.until(lambda: context.legs.reporting, FIRST_REPORT)
        context.legs.check_walking()
        view, approaches = await self._look(context, goal), 0
        while not _good(view, goal) and approaches < goal.approaches:
            if view.distance > FARTHEST:
                raise StageFailed("look", "dock", f"The stance is {view.distance:.2f} m away; navigate nearer first.")
            context.say("approach", f"{100 * view.distance:.0f} cm to go.")
            await approach(context, navigator, PlanarPose.of(context.legs.pose) @ view.left)
            approaches += 1
            before, view = view, await self._look(context, goal)
            if before.here is not None and view.here is not None:
                if view.here.quality < before.here.quality + GAIN:
                    break  # these legs stand no better
        return _result(view, goal, approaches, context.t - start)

    async def _look(self, context: Context, goal: DockGoal) -> _View:
        """Measure where the stance is, as seen from the robot."""
        context.legs.drive(Twist())
        await context.sleep(SETTLE)
        edge = await see_edge(context)
        across = edge.pose.to(PlanarPose(0.0, 0.0, 0.0))
        lateral = across.y if goal.lateral is None else goal.lateral
        view = _View(edge.pose @ PlanarPose(-goal.standoff, lateral, 0.0), edge)
        if goal.stance == "reach" and -across.x < goal.standoff + IN_VIEW:
            avoid, wanted = floor_places("docking", goal.avoid), floor_places("docking", goal.wanted)
            known = self._tray is not None
            seen = await see_fasteners(context, goal.label, goal.container, avoid, not known, wanted)
            tray, T = seen.tray, context.legs.pose
            if tray is not None:
                self._tray = T[:3, :3] @ tray + T[:3, 3]
            elif self._tray is not None:
                tray = T[:3, :3].T @ (self._tray - T[:3, 3])
            if len(seen.places):
                drops = context.legs.drops
                best = best_stance(edge.pose, seen.places, seen.weights, tray, drops)
                view = _View(best.pose, edge, stance_here(seen.places, seen.weights, tray, drops), best)
        text = f"{100 * view.distance:.1f} cm and {math.degrees(view.left.yaw):.1f} deg from the stance"
        if view.here is not None and view.best is not None:
            text += f", {view.here.served} {goal.label}s within reach here, {view.best.served} there"
            text += f" (quality {view.here.quality:.2f} and {view.best.quality:.2f})"
        context.say("look", f"{text}.", left=[view.left.x, view.left.y, view.left.yaw])
        return view


def _good(view: _View, goal: DockGoal) -> bool:
    if view.here is not None and view.best is not None and view.best.quality > NOTHING:
        return view.here.quality >= GOOD * view.best.quality
    return view.distance <= goal.tolerance and abs(view.left.yaw) <= goal.turned


def _result(view: _View, goal: DockGoal, approaches: int, seconds: float) -> SkillResult:
    left, edge = view.left, view.edge
    report = DockReport((left.x, left.y, left.yaw), approaches=approaches)
    text = f"Standing {100 * view.distance:.1f} cm and {math.degrees(left.yaw):.1f} deg from the stance"
    text += f" after {approaches} approaches, by an edge of {edge.length:.2f} m, straight to {1e3 * edge.spread:.0f} mm"
    if view.here is not None:
        report.quality, report.served = view.here.quality, view.here.served
        text += f"; {view.here.served} {goal.label}s are within reach"
    if not _good(view, goal) and not report.served:
        return SkillResult(False, "approach", "lower_body", f"Not good enough. {text}.", value=report)
    return SkillResult(True, "done", None, f"{text}.", {"dock": seconds}, report)
