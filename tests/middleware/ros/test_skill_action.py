"""A skill of `golem.skills` behind an action: started by a goal, stepped by its owner, cancelled at an await."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("rosbags")

from golem.middleware.ros.action_server import ServerGoal
from golem.middleware.ros.codec import action
from golem.middleware.ros.goals import CancelCode, GoalStatus
from golem.middleware.ros.msgs import golem_interfaces as msgs
from golem.skills.base import SkillCancelled, SkillResult, Tick
from golem.skills.runner import SkillRun

from .conftest import PICK, World

Pick = action(PICK)


class SkillServer:
    """Runs one skill at a time."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.released = False
        self._goal: ServerGoal | None = None
        self._run: SkillRun | None = None

    def decide(self, request: Any) -> bool:
        return self._goal is None

    def accepted(self, goal: ServerGoal) -> None:
        self._goal, self._run = goal, SkillRun("count", self._skill(int(goal.request.label)))
        goal.execute()

    def cancel(self, goal: ServerGoal) -> bool:
        return True

    def step(self) -> None:
        if self._goal is None or self._run is None:
            return
        if self._goal.status is GoalStatus.CANCELING:
            self._run.cancel()
        else:
            self._run.step()
        for text in self.said:
            self._goal.feedback(Pick.Feedback(msgs.SkillFeedback(text=text)))
        self.said.clear()
        if self._run.result is not None:
            self._finish(self._goal, self._run.result)
            self._goal = None

    def _finish(self, goal: ServerGoal, result: SkillResult) -> None:
        message = Pick.Result(msgs.SkillResult(success=result.success, stage=result.stage))
        if result.success:
            goal.succeed(message)
        elif result.stage == "cancelled":
            goal.canceled(message)
        else:
            goal.abort(message)

    async def _skill(self, steps: int) -> SkillResult:
        try:
            for step in range(steps):
                self.said.append(f"{step}")
                await Tick()
        except SkillCancelled:
            self.released = True
            raise
        if steps == 0:
            raise ValueError("nothing to count")
        return SkillResult(True, "done", None, "")


@pytest.fixture
def skills() -> SkillServer:
    return SkillServer()


def send(world: World, skills: SkillServer, label: str, heard: list[str]) -> tuple[Any, Any]:
    world.node("server").action_server("count", PICK, skills)
    client = world.node("client").action_client("count", PICK)
    world.until(client.ready)
    goal = world.get(client.send_goal(Pick.Goal(label), lambda f: heard.append(f.feedback.text)))
    assert not world.get(client.send_goal(Pick.Goal("1"))).accepted
    return goal, goal.result()


def pursue(world: World, skills: SkillServer, outcome: Any) -> Any:
    def stepped() -> bool:
        skills.step()
        return outcome.done

    world.until(stepped)
    return outcome.result()


@pytest.mark.parametrize(("label", "status"), [("3", GoalStatus.SUCCEEDED), ("0", GoalStatus.ABORTED)])
def test_a_skill_runs_behind_an_action(world: World, skills: SkillServer, label: str, status: GoalStatus) -> None:
    heard: list[str] = []
    _, outcome = send(world, skills, label, heard)
    assert pursue(world, skills, outcome).status is status
    world.until(lambda: len(heard) == int(label))
    assert heard == [f"{i}" for i in range(int(label))]


def test_a_skill_is_cancelled_at_its_await(world: World, skills: SkillServer) -> None:
    goal, outcome = send(world, skills, "1000000", [])
    for _ in range(3):
        skills.step()
    assert world.get(goal.cancel()).code is CancelCode.NONE
    assert not skills.released
    assert pursue(world, skills, outcome).status is GoalStatus.CANCELED
    assert skills.released
