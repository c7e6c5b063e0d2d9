"""Planned motions through the real node of the arms: there, along lines, refused, and stopped at every stage."""

from __future__ import annotations

import re
from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np
import pytest

from golem.capabilities.arms.diff_ik import DiffIK
from golem.capabilities.arms.postures import downward, posture
from golem.capabilities.collision.obstacles import Obstacle, World
from golem.capabilities.memory.object_map import ObjectMap
from golem.capabilities.planning.base import PlanRefused, Refusal
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.capabilities.planning.plan_kernel import ITSELF
from golem.capabilities.planning.rrt_connect import RrtConnect
from golem.capabilities.properties.property_table import PropertyTable
from golem.interfaces import topics
from golem.interfaces.payloads import GateState, GateStatus
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.table import JOINT_NAMES
from golem.runtime.contract_check import ContractCheck
from golem.runtime.nodes import UpperBodyNode
from golem.skills.base import REFUSED, SkillResult
from golem.skills.context import Context, Modules
from golem.skills.planned_motion import FARTHEST, PlannedMotion, Then, apart
from golem.skills.runner import SkillRun
from golem.skills.travel import LineTravel, PlannedTravel
from golem.types import NUM_JOINTS, UPPER, Array, BaseEstimate, Imu, LowState, Side

PERIOD = 0.01
DONE = SkillResult(True, "done", None, "There.")
OVER: Array = downward(0.45, -0.12, 0.10, -0.5 * np.pi)
ROLL, PITCH = (JOINT_NAMES[UPPER].index(f"right_{joint}_joint") for joint in ("shoulder_roll", "shoulder_pitch"))
STILL = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))


class Rig:
    """Arms that are always where they were sent, but for joints that something stops, under an open gate."""

    def __init__(self, planner: RrtConnect, q: Array | None = None) -> None:
        self.bus, self.t, self.stops = Bus(), 0.0, np.full(15, np.inf)
        self.q, self.sag = posture("home") if q is None else q, np.zeros(15)
        self.node = UpperBodyNode(self.bus, DiffIK(), ContractCheck("upper_body", "diff_ik"))
        modules = Modules(
            lambda: pytest.fail(), lambda name: pytest.fail(), lambda: planner, ObjectMap(), PropertyTable()
        )
        self.context = Context(self.bus, Kinematics(), PERIOD, modules)
        self.step()

    def step(self) -> None:
        self.t += PERIOD
        q = np.zeros(NUM_JOINTS)
        q[UPPER] = np.minimum(self.q, self.stops) - self.sag
        zero = np.zeros(NUM_JOINTS)
        self.bus.publish(topics.BASE, BaseEstimate(self.t, np.eye(4)), self.t)
        self.bus.publish(topics.LOW_STATE, LowState(self.t, q, zero, zero, STILL), self.t)
        self.bus.deliver(self.t)
        self.node.step(self.t)
        self.bus.publish(topics.SAFETY, GateStatus(self.t, GateState.ACTIVE), self.t)
        self.bus.deliver(self.t + 0.5 * PERIOD)
        command = self.bus.latest(topics.ARM_COMMAND)
        if command is not None:
            self.q = command.q.copy()
        self.context.refresh(self.t)

    def run(self, skill: Coroutine[None, None, SkillResult], ticks: int = 2000) -> SkillRun:
        """Run a skill to its end, or for so many ticks."""
        run = SkillRun("scripted", skill)
        for _ in range(ticks):
            if run.result is not None:
                break
            self.step()
            run.step()
        return run


@pytest.fixture(scope="module")
def planner() -> RrtConnect:
    return RrtConnect()


@pytest.fixture
def rig(planner: RrtConnect) -> Rig:
    return Rig(planner)


async def _over(context: Context, prepare: Callable[[PlannedMotion], Any] = lambda motion: None) -> SkillResult:
    motion = PlannedMotion(context)
    prepare(motion)
    down = OVER.copy()
    down[2, 3] -= 0.1
    await motion.to({"right": OVER}, 0.25, then=[Then("right", down, 0.1)])
    await motion.line("right", down, 0.1)
    return DONE


def test_a_hand_gets_there_and_goes_straight_down(rig: Rig) -> None:
    assert rig.run(_over(rig.context)).result == DONE
    pose = rig.context.kinematics.pose("right_gripper")
    np.testing.assert_allclose(pose[:3, 3], [0.45, -0.12, 0.0], atol=1e-3)
    assert pose[2, 2] < -np.cos(np.deg2rad(0.5))


def test_back_to_the_joints_it_came_from(rig: Rig) -> None:
    home = rig.q.copy()

    async def there_and_back(context: Context) -> SkillResult:
        await _over(context)
        await PlannedMotion(context).to_joints(home, ["right"], 0.25)
        return DONE

    assert rig.run(there_and_back(rig.context)).result == DONE
    np.testing.assert_allclose(rig.q, home, atol=1e-6)


@pytest.mark.parametrize(
    ("at", "world", "refusal", "words"),
    [
        ((0.95, -0.12, 0.1), (), Refusal.UNREACHABLE, r"gets no nearer than \d+ mm"),
        ((0.45, -0.12, 0.1), ((0.45, -0.12, 0.1),), Refusal.GOAL, "something is in the way"),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_moves(
    rig: Rig, at: tuple[float, ...], world: tuple[tuple[float, ...], ...], refusal: Refusal, words: str
) -> None:
    refusals: list[PlanRefused] = []

    async def there(context: Context) -> SkillResult:
        motion, T = PlannedMotion(context), OVER.copy()
        T[:3, 3] = at
        boxes: list[Obstacle] = []
        for corner in world:
            boxes.append(Obstacle("box", T.copy(), (0.05, 0.05, 0.05)))
            boxes[-1].T_base_obstacle[:3, 3] = corner
        motion.world = World(boxes)
        try:
            await motion.to({"right": T}, 0.25)
        except PlanRefused as refused:
            refusals.append(refused)
        return DONE

    before = rig.q.copy()
    assert rig.run(there(rig.context)).result == DONE
    assert refusals[0].refusal is refusal
    assert re.search(words, str(refusals[0]))
    np.testing.assert_array_equal(rig.q, before)


def test_an_arm_that_is_held_off_gives_in_and_goes_on(rig: Rig) -> None:
    home = rig.q.copy()
    pressed = home.copy()
    pressed[PITCH] += 0.15
    rig.stops[PITCH] = home[PITCH] + 0.02

    async def press_and_return(context: Context) -> SkillResult:
        await context.follow(np.array([0.5]), pressed[None])
        await PlannedMotion(context).to_joints(home, ["right"], 0.25)
        return DONE

    assert rig.run(press_and_return(rig.context)).result == DONE
    np.testing.assert_allclose(rig.q, home, atol=1e-6)


def test_an_arm_that_sags_more_than_a_trajectory_allows_goes_all_the_same(rig: Rig) -> None:
    rig.sag[PITCH] = 0.12

    async def there(context: Context) -> SkillResult:
        await PlannedMotion(context).to_joints(posture("ready"), ["right"], 0.25)
        return DONE

    assert rig.run(there(rig.context)).result == DONE
    np.testing.assert_allclose(rig.q[8:], posture("ready")[8:], atol=1e-6)


def test_arms_that_touch_the_robot_come_off_and_go_on(rig: Rig) -> None:
    home = rig.q.copy()
    space = JointSpace(PlanningRobot(), home)
    touching = home.copy()
    while space.verdict(touching) == 0:
        touching[ROLL] += 0.01
    assert space.verdict(touching) == ITSELF
    touching[ROLL] += 0.02
    way: list[Array] = []

    async def touch_and_return(context: Context) -> SkillResult:
        await context.follow(np.array([2.0]), touching[None])
        way.append((await PlannedMotion(context).to_joints(home, ["right"], 0.25)).q)
        return DONE

    assert rig.run(touch_and_return(rig.context)).result == DONE
    np.testing.assert_allclose(rig.q, home, atol=1e-6)
    assert (space.verdicts(way[0]) == 0).all()


async def refused(*_: object) -> None:
    raise PlanRefused(Refusal.NO_PATH, "There is no way.")


def test_arms_that_hang_are_raised_before_the_work_begins_and_return_there(
    planner: RrtConnect, monkeypatch: pytest.MonkeyPatch
) -> None:
    home, left = posture("home"), np.array([0.06, 0.03, 0.30, 1.56, 2.10, -0.26, -0.69])
    rig = Rig(planner, np.array([0.0, *left, *(left * (1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0))]))
    assert JointSpace(PlanningRobot(), rig.q).verdict(rig.q) == ITSELF

    sent: list[Array] = []

    async def go(lines: LineTravel, side: Side, T_goal: Array, speed: float) -> None:
        sent.append(T_goal)

    async def begin(context: Context) -> SkillResult:
        travel = PlannedTravel(context, LineTravel(context, 0.1, 0.002), 0.002)
        await travel.begin(0.25)
        monkeypatch.setattr(PlannedMotion, "to_joints", refused)
        await travel.home("right", 0.25)
        np.testing.assert_allclose(sent, context.arms["right"].pose[None], atol=1e-3)
        return DONE

    monkeypatch.setattr(LineTravel, "_go", go)
    assert rig.run(begin(rig.context)).result == DONE
    np.testing.assert_allclose(rig.q, home, atol=1e-6)


def test_what_comes_apart_is_free_and_near_and_not_everything_does() -> None:
    robot, rng = PlanningRobot(), np.random.default_rng(0)
    space = JointSpace(robot, posture("home"))
    drawn = rng.uniform(robot.lower, robot.upper, (200, 15))
    found = [apart(space, robot.model(), q) for q in drawn]
    for q, off in zip(drawn, found, strict=True):
        if off is not None:
            assert space.verdict(off) == 0 and np.abs(off - q).max() <= FARTHEST
    touching = [off for q, off in zip(drawn, found, strict=True) if space.verdict(q) == ITSELF]
    apart_count = sum(off is not None for off in touching)
    assert 0.1 < apart_count / len(touching) < 0.9


def test_a_refusal_that_a_skill_lets_through_is_its_result(rig: Rig) -> None:
    async def far(context: Context) -> SkillResult:
        T = OVER.copy()
        T[0, 3] = 1.5
        await PlannedMotion(context).to({"right": T}, 0.25)
        return DONE

    result = rig.run(far(rig.context)).result
    assert result is not None and result.stage == REFUSED and "gets no nearer" in result.reason


def test_cancelled_at_every_stage_the_arms_stay_where_they_are(planner: RrtConnect) -> None:
    whole = Rig(planner)
    whole.run(_over(whole.context))
    length = round(whole.t / PERIOD)
    for ticks in (1, 3, 8, *np.linspace(10, length - 5, 6).astype(int)):
        rig = Rig(planner)
        run = rig.run(_over(rig.context), int(ticks))
        run.cancel()
        assert run.result is not None and run.result.stage == "cancelled"
        rig.context.release_arms()
        rig.step()
        rig.step()
        stopped = rig.q.copy()
        for _ in range(30):
            rig.step()
        np.testing.assert_allclose(rig.q, stopped, atol=1e-4)
