"""A stop reaches motors and hands, also when it is a module that died."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.errors import ModuleFault
from golem.interfaces import topics
from golem.interfaces.payloads import GateState, HandGoal
from golem.runtime.lockstep import build
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.stack import Choice, Stack
from golem.types import PalmTargets

DYING_ARMS = """
from golem.capabilities.arms.diff_ik import DiffIK

class Dying(DiffIK):
    def step(self, left, right, q, dt):
        self.ticks = getattr(self, "ticks", 0) + 1
        if self.ticks > 20:
            raise RuntimeError("gone")
        return super().step(left, right, q, dt)
"""


class Wait:
    """Does nothing until it is ended from outside."""

    name = "wait"

    async def run(self, context: Context, goal: object) -> SkillResult:
        """Wait."""
        await context.sleep(60.0)
        return SkillResult(True, "done", None, "")


def test_the_motors_damp_when_a_module_dies(tmp_path: Path) -> None:
    (tmp_path / "arms.py").write_text(DYING_ARMS)
    stack = Stack({"upper_body": Choice(f"{tmp_path / 'arms.py'}:Dying")}, profile="ideal")
    running, robot = build(stack, seed=0)
    with pytest.raises(ModuleFault, match="gone"):
        running.execute(Wait(), None, 5.0)
    robot.close()
    assert running.executor.t == pytest.approx(0.2, abs=0.02)
    assert running.safety is not None and running.safety.state is GateState.STOP1
    command = running.bus.latest(topics.LOW_CMD)
    assert command is not None
    assert not command.kp.any() and (command.kd > 0.0).all() and not command.tau.any()


class Reach:
    """Sends the right hand 10 cm up, and stays there or ends."""

    name = "reach"

    def __init__(self, stay: bool) -> None:
        self._stay = stay

    async def run(self, context: Context, goal: object) -> SkillResult:
        """Reach."""
        arm = context.arms["right"]
        T = arm.pose
        T[2, 3] += 0.1
        await arm.move(T, 0.3)
        if self._stay:
            await context.sleep(60.0)
        return SkillResult(True, "done", None, "")


@pytest.mark.parametrize("stopped", [False, True])
def test_no_arm_is_drawn_to_where_a_skill_or_a_stop_left_it(stopped: bool) -> None:
    running, robot = build(Stack(profile="ideal"), seed=0)

    def sent() -> PalmTargets:
        targets = running.bus.latest(topics.PALM_TARGETS)
        assert targets is not None
        return targets

    run = running.start(Reach(stay=stopped), None)
    running.executor.run(0.5)
    assert sent().right is not None and sent().left is None
    if stopped:
        running.estop.press()
        running.executor.run(0.6)
        run.cancel()
    else:
        running.executor.run(2.0, lambda: run.result is not None)
    running.executor.run(running.executor.t + 0.02)
    assert sent().right is None and sent().left is None
    robot.close()


def test_a_stopped_hand_stays_as_it_is_and_forgets_what_it_was_told() -> None:
    running, robot = build(Stack(profile="ideal"), seed=0)

    def gap() -> float:
        state = running.bus.latest(topics.hand_state("right"))
        assert state is not None
        return state.gap

    def tell(goal: HandGoal) -> None:
        running.bus.publish(topics.hand_goal("right"), goal, running.executor.t)

    running.executor.run(0.2)
    tell(HandGoal(0.09))
    running.executor.run(0.5)
    moving = gap()
    running.estop.press()
    running.executor.run(0.8)
    stopped = gap()
    assert running.safety is not None and running.safety.state is GateState.STOP1
    tell(HandGoal(None, 16.0))
    running.executor.run(2.0)
    robot.close()
    assert moving > 0.065
    np.testing.assert_allclose(gap(), stopped, atol=1e-3)
    assert stopped < moving + 0.01
