"""Working along a pack: dock, pick, and dock again where a pick says that nothing more is within reach."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from golem.options import require
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.dock import DockGoal, DockReport
from golem.skills.pick_config import PickGoal
from golem.skills.pick_report import PickOutcome, PickReport, Sight

LEFT = (PickOutcome.TIGHT, PickOutcome.JAMMED, PickOutcome.SLIPPED, PickOutcome.NOTHING_THERE)
"""What is said of a fastener that is tried again only where there is no other."""
AGAIN = (*LEFT, PickOutcome.OUT_OF_REACH, PickOutcome.BLOCKED, PickOutcome.TRAY_MISSING, PickOutcome.TRAY_OUT_OF_REACH)
"""What a pick says where another stance may help: others are within reach there, or it is free."""


@dataclass(frozen=True, slots=True)
class DisassembleGoal:
    """What to take out.

    Attributes:
        count: objects to pick.
        docks: how often the robot may look for another stance, the first time included; 0 stays where it is.
        dock: how it docks.
        pick: what it picks, with which hand.
    """

    count: int = 1
    docks: int = 3
    dock: DockGoal = field(default_factory=DockGoal)
    pick: PickGoal = field(default_factory=lambda: PickGoal(side="either"))

    def __post_init__(self) -> None:
        require(
            "goal of disassembling: ",
            ("count", self.count, 1 <= self.count <= 100, "from 1 to 100"),
            ("docks", self.docks, 0 <= self.docks <= 20, "from 0 to 20"),
        )


@dataclass
class DisassembleReport:
    """What was done.

    Attributes:
        picked: objects in the container.
        docks: how the robot stood after every docking, in order.
        picks: what every pick found out, in order.
    """

    picked: int = 0
    docks: list[DockReport] = field(default_factory=list[DockReport])
    picks: list[PickReport] = field(default_factory=list[PickReport])


class Disassemble:
    """Take fasteners out of a pack: dock, pick, and dock again where none is within reach any more.

    Stages: those of `dock` and `pick`, and `done`.
    """

    Goal, Result = DisassembleGoal, DisassembleReport

    def timeout(self, goal: DisassembleGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return 180.0 * (goal.docks + 1) + 120.0 * (goal.count + goal.docks)

    async def run(self, context: Context, goal: DisassembleGoal) -> SkillResult:
        """Go along the pack; see `Skill`."""
        start, report, docks = context.t, DisassembleReport(), goal.docks
        if docks:
            docked = await self._dock(context, goal, report)
            docks -= 1
            if not docked.success and not report.docks[-1].served:
                return SkillResult(False, docked.stage, docked.slot, docked.reason, value=report)
        while True:
            result = await context.run("pick", goal.pick)
            found = result.value if isinstance(result.value, PickReport) else PickReport()
            report.picks.append(found)
            if result.success and found.in_tray == Sight.NO:
                text = f"The {goal.pick.label} that was let go is not in the {goal.pick.container}."
                result = replace(result, success=False, stage="place", slot="localizer", reason=text)
            report.picked += result.success
            timings = {"total": context.t - start, **result.timings}
            if report.picked >= goal.count:
                text = f"{report.picked} of {goal.count} picked after {len(report.docks)} dockings."
                context.say("done", text)
                return SkillResult(True, "done", None, text, timings, report)
            if result.success:
                continue
            if not docks or not _worth_another(found):
                return SkillResult(False, result.stage, result.slot, result.reason, timings, report)
            context.say(result.stage, f"{result.reason} Looking for another stance.")
            goal = _without(goal, found)
            await self._dock(context, goal, report)
            docks -= 1

    async def _dock(self, context: Context, goal: DisassembleGoal, report: DisassembleReport) -> SkillResult:
        docked = await context.run("dock", goal.dock)
        report.docks.append(docked.value if isinstance(docked.value, DockReport) else DockReport())
        return docked


def _worth_another(found: PickReport) -> bool:
    """Return whether another stance may help: not where nothing was seen, unless something was tried before."""
    seen = found.tried or found.outcome != PickOutcome.NOTHING_THERE
    return bool(seen) and found.outcome in (*AGAIN, PickOutcome.PICKED)


def _without(goal: DisassembleGoal, found: PickReport) -> DisassembleGoal:
    """Return the goal that leaves what a pick has tried in vain for later."""
    left = [place for one in found.tried if one.outcome in LEFT for place in (one.x, one.y)]
    avoid = (*goal.dock.avoid, *left)
    return replace(goal, dock=replace(goal.dock, avoid=avoid), pick=replace(goal.pick, avoid=avoid))
