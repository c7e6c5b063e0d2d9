"""A thing is searched for where it was, then where others were, then where the map ends."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest
from tests.skills.conftest import modules
from tests.skills.test_fetch import DONE, LEGS, Scripted

from golem.errors import ConfigError
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.runtime.lockstep import build
from golem.skills import search
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.fetch import STAGE
from golem.skills.navigate import Navigate, NavigateGoal
from golem.skills.recall import RecalledPlace, RecalledPlaces
from golem.skills.remember import Remember
from golem.skills.runner import SkillRun
from golem.skills.search import Search, SearchGoal
from golem.stack import load_stack
from golem.types import BaseEstimate, PlanarPose


def test_a_goal_without_sense_is_refused() -> None:
    for text, places in ((" ", 5), ("mug", 31), ("mug", -1)):
        with pytest.raises(ConfigError):
            SearchGoal(text, places=places)


class Teleport(Scripted):
    """Walks in no time."""

    async def run(self, context: Context, goal: NavigateGoal) -> SkillResult:
        """Be there."""
        pose = PlanarPose(goal.x, goal.y, goal.yaw)
        context.publish(topics.BASE, BaseEstimate(context.t, pose.matrix()))
        return await super().run(context, goal)


def test_each_place_is_looked_at_once_from_whichever_side_it_is_come_to(monkeypatch: pytest.MonkeyPatch) -> None:
    spots = [(2.0, 0.0), (2.0, 1.0), (-2.0, 0.0)]
    places = [RecalledPlace("mug", x, y, 0.0, 1.0, 60.0, 60.0, "gone") for x, y in spots]

    async def ask(context: Context, text: str, when: str, *_: object) -> RecalledPlaces:
        return RecalledPlaces("odom", places if when == "anywhere" else [])

    monkeypatch.setattr(search, "ask", ask)
    walks = Teleport(Navigate, [DONE] * 6)
    skills = {"navigate": walks, "remember": Scripted(Remember, [DONE] * 7)}
    context = Context(Bus(), Kinematics(), 0.01, modules(skill=skills.__getitem__, memory=SimpleNamespace()))
    context.bus.publish(topics.LEG_STATUS, replace(LEGS, speed=0.3), 0.0)
    run = SkillRun("search", Search().run(context, SearchGoal("mug")))
    for _ in range(50):
        context.refresh(context.t + 0.01)
        run.step()
    assert run.result is not None and not run.result.success, run.error
    seen = [PlanarPose(g.x, g.y, g.yaw) @ PlanarPose(STAGE, 0.0, 0.0) for g in walks.goals]
    assert [(p.x, p.y) for p in seen] == [pytest.approx(spot, abs=1e-6) for spot in spots]


@pytest.mark.slow
def test_what_is_in_view_is_found_and_what_is_not_is_said() -> None:
    running, robot = build(load_stack("counter-tether", profile="ideal"), 0)
    try:
        found = running.execute("search", {"text": "mug"})
        assert found.success and found.value.places[0].label == "mug"
        missing = running.execute("search", {"text": "handle"})
        assert not missing.success and "from 1 places" in missing.reason
    finally:
        robot.close()
