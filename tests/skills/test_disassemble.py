"""Working along a pack with dockings and picks that go as a test says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from tests.skills.conftest import modules

from golem.errors import ConfigError
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.disassemble import Disassemble
from golem.skills.disassemble_goal import DisassembleGoal
from golem.skills.dock import Dock, DockGoal, DockReport
from golem.skills.pick import Pick
from golem.skills.pick_config import PickGoal, PickOutcome, PickReport, Sight, Tried
from golem.skills.runner import SkillRun

GONE = PickOutcome.OUT_OF_REACH


class Scripted:
    """A skill that ends at once, each time with the next of its results."""

    def __init__(self, kind: type[Any], results: list[SkillResult]) -> None:
        self.Goal, self.results, self.goals = kind.Goal, results, list[Any]()

    def timeout(self, goal: object) -> float:
        """Allow a second."""
        return 1.0

    async def run(self, context: Context, goal: object) -> SkillResult:
        """End."""
        self.goals.append(goal)
        return self.results[len(self.goals) - 1]


def docked(success: bool = True, served: int = 3) -> SkillResult:
    slot = None if success else "dock"
    return SkillResult(success, "done" if success else "look", slot, "", value=DockReport(served=served))


def picked(outcome: PickOutcome) -> SkillResult:
    success = outcome is PickOutcome.PICKED
    report = PickReport(outcome.value)
    return SkillResult(success, "done" if success else "detect", None if success else "localizer", "", value=report)


def work(
    goal: DisassembleGoal, docks: Sequence[SkillResult], picks: Sequence[SkillResult]
) -> tuple[SkillResult, int, int]:
    """Return how it ended, and how often the robot docked and picked."""
    skills = {"dock": Scripted(Dock, list(docks)), "pick": Scripted(Pick, list(picks))}
    context = Context(Bus(), Kinematics(), 0.01, modules(skill=skills.__getitem__))
    run = SkillRun("disassemble", Disassemble().run(context, goal))
    for _ in range(100):
        run.step()
    assert run.error is None and run.result is not None
    return run.result, len(skills["dock"].goals), len(skills["pick"].goals)


def test_it_docks_then_picks() -> None:
    result, docks, picks = work(DisassembleGoal(), [docked()], [picked(PickOutcome.PICKED)])
    assert result.success and (docks, picks, result.value.picked) == (1, 1, 1)


def test_it_docks_again_where_nothing_is_within_reach() -> None:
    picks = [picked(PickOutcome.PICKED), picked(GONE), picked(PickOutcome.PICKED)]
    result, docked_, picked_ = work(DisassembleGoal(2), [docked(), docked()], picks)
    assert result.success and (docked_, picked_, result.value.picked) == (2, 3, 2)


def test_it_ends_where_another_stance_would_not_help_or_none_is_left() -> None:
    for outcome in (PickOutcome.TRAY_FULL, PickOutcome.NOTHING_THERE):
        result, docks, picks = work(DisassembleGoal(), [docked()], [picked(outcome)])
        assert not result.success and (docks, picks) == (1, 1) and result.value.picks[0].outcome == outcome
    result, docks, picks = work(DisassembleGoal(docks=2), [docked()] * 2, [picked(GONE)] * 2)
    assert not result.success and (docks, picks) == (2, 2)
    result, docks, picks = work(DisassembleGoal(docks=0), [], [picked(GONE)])
    assert not result.success and (docks, picks) == (0, 1)


def test_what_was_tight_is_avoided_at_the_next_stance() -> None:
    tight = picked(PickOutcome.TIGHT)
    tight.value.tried = [Tried("right", 0.4, -0.1, 0.0, "tight"), Tried("left", 0.5, 0.1, 0.0, "failed")]
    skills = {"dock": Scripted(Dock, [docked()] * 2), "pick": Scripted(Pick, [tight, picked(PickOutcome.PICKED)])}
    context = Context(Bus(), Kinematics(), 0.01, modules(skill=skills.__getitem__))
    run = SkillRun("disassemble", Disassemble().run(context, DisassembleGoal()))
    for _ in range(100):
        run.step()
    assert run.result is not None and run.result.success
    assert [goal.avoid for goal in skills["dock"].goals] == [(), (0.4, -0.1)]
    assert [goal.avoid for goal in skills["pick"].goals] == [(), (0.4, -0.1)]


@pytest.mark.parametrize("outcome", [PickOutcome.SLIPPED, PickOutcome.BLOCKED, PickOutcome.NOTHING_THERE])
def test_what_was_tried_in_vain_is_tried_from_another_stance(outcome: PickOutcome) -> None:
    vain = picked(outcome)
    vain.value.tried = [Tried("right", 0.4, -0.1, 0.0, outcome)]
    result, docks, picks = work(DisassembleGoal(), [docked()] * 2, [vain, picked(PickOutcome.PICKED)])
    assert result.success and (docks, picks) == (2, 2)


def test_what_is_not_seen_in_the_container_does_not_count() -> None:
    beside = picked(PickOutcome.PICKED)
    beside.value.in_tray = Sight.NO.value
    result, docks, picks = work(DisassembleGoal(), [docked()] * 2, [beside, picked(PickOutcome.PICKED)])
    assert result.success and (docks, picks, result.value.picked) == (2, 2, 1)
    result, _, picks = work(DisassembleGoal(docks=1), [docked()], [beside])
    assert not result.success and (result.stage, picks) == ("place", 1)


def test_a_docking_that_fails_ends_it_unless_something_is_within_reach() -> None:
    result, _, picks = work(DisassembleGoal(), [docked(False, 0)], [])
    assert (result.success, result.slot, picks) == (False, "dock", 0)
    result, _, picks = work(DisassembleGoal(), [docked(False, 2)], [picked(PickOutcome.PICKED)])
    assert result.success and picks == 1


@pytest.mark.parametrize("wrong", [{"count": 0}, {"docks": -1}, {"docks": 99}])
def test_a_goal_without_sense_is_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(ConfigError, match="goal of disassembling"):
        DisassembleGoal(**wrong)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ConfigError, match="class of the fasteners"):
        DockGoal(label="")
    assert DisassembleGoal().pick == PickGoal(side="either")
