"""The node of the navigator, which drives the legs towards the goal that a skill set, and its link to Nav2."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Literal

from golem.capabilities.mapping.robot_filter import RobotFilter
from golem.capabilities.navigation.base import Navigator, NavInputs
from golem.capabilities.navigation.footprint import Footprint
from golem.errors import ModuleFault
from golem.interfaces import topics
from golem.interfaces.nav_payloads import HERE, Nav2Goal, Nav2Reply, NavGoal, NavPath, NavStep, OccupancyGrid
from golem.interfaces.payloads import ModuleFaultMsg
from golem.middleware.bus import Bus, News
from golem.runtime.contract_check import ContractCheck
from golem.runtime.executor import Node
from golem.runtime.nodes import SkillNode
from golem.skills.base import StageFailed
from golem.skills.body_interface import LegsInterface
from golem.skills.runner import LACKS
from golem.types import Array, PlanarPose, Twist


class BusNav2:
    """See `golem.capabilities.navigation.nav2.Nav2Link`."""

    def __init__(self, bus: Bus) -> None:
        self._bus, self._number = bus, 0
        self._twists = News(bus, topics.NAV2_TWIST)

    def send(self, pose: PlanarPose) -> None:
        self._number += 1
        self._twists.read()
        self._bus.publish(topics.NAV2_GOAL, Nav2Goal(self._number, pose), 0.0)  # no latency: the time has no meaning

    def reply(self) -> Nav2Reply | None:
        reply = self._bus.latest(topics.NAV2_REPLY)
        return None if reply is None or reply.number != self._number else reply

    def twist(self) -> Twist | None:
        said = self._twists.read()
        return None if said is None else said.twist


ZERO = Twist()
BODY_MARGIN = 0.01
"""By how much the robot's footprint is wider than its spheres [m]: these are conservative already."""


class NavigatorNode(Node):
    """Runs the navigator while a skill has a goal for it. It has its turn after the skill, in the same tick.

    A fault of it ends the skill, and nothing else. One navigator serves all goals: it may learn how these legs stop.
    """

    period = SkillNode.period

    def __init__(
        self, bus: Bus, navigator: Navigator, contract: ContractCheck, legs: LegsInterface, pool: Executor | None = None
    ) -> None:
        """Run a navigator, one with a latency in `pool`; None is here, at the price of the latency that it declares."""
        self._bus, self._navigator, self._slot, self._legs, self._pool = (bus, navigator, contract.slot, legs, pool)
        self._worker = pool if navigator.latency > 0.0 else None
        self._latency = 0.0 if self._worker is not None else navigator.latency
        self._every = max(1, round(1.0 / (navigator.rate * self.period)))
        self._goals = News(bus, topics.NAV_GOAL)
        self._robot: RobotFilter | None = None
        self._footprint: Footprint | None = None
        self._footprint_due = 0.0
        self._shown: Array | None = None
        self._grid: tuple[OccupancyGrid | None, OccupancyGrid | None] = None, None
        self._pursue(NavGoal(None))

    def step(self, t: float) -> None:
        goal = self._goals.read()
        if goal is not None:
            self._pursue(goal)
        if self._goal is None:
            return
        try:
            self._advance(t)
        except ModuleFault as fault:
            self._give_up(ModuleFaultMsg(fault.slot, str(fault)), t)
            return
        except StageFailed as lost:
            self._give_up(ModuleFaultMsg(lost.slot, str(lost), lost.stage), t)
            return
        except LACKS as lack:
            if self._pool is None:
                raise
            self._give_up(ModuleFaultMsg(self._slot, str(lack)), t)
            return
        newest = self._bus.latest(topics.NAV_STEP)
        if newest is not None and self._bus.count(topics.NAV_STEP) > self._seen:
            if newest.path is not None and newest.path is not self._shown:
                self._shown = newest.path
                self._bus.publish(topics.NAV_PATH, NavPath(t, newest.path, self._frame), t)
            self._legs.drive(ZERO if newest.ended else newest.twist)

    def _pursue(self, goal: NavGoal) -> None:
        """Forget the previous goal, with every step that was on its way."""
        self._bus.withdraw(topics.NAV_STEP)
        self._goal = self._unstarted = goal.pose
        self._frame: Literal["odom", "map"] = goal.frame
        self._seen = self._bus.count(topics.NAV_STEP)
        self._ticks, self._stepped_at = 0, -1
        self._job: Future[NavStep] | None = None

    def _advance(self, t: float) -> None:
        """Publish the step that is due, or that the thread has found."""
        self._ticks += 1
        if self._job is not None:
            if not self._job.done():
                return
            job, self._job = self._job, None
            self._bus.publish(topics.NAV_STEP, job.result(), t)
        if self._stepped_at >= 0 and self._ticks - self._stepped_at < self._every:
            return
        since = self._every if self._stepped_at < 0 else self._ticks - self._stepped_at
        self._stepped_at = self._ticks
        think = self._thought(since * self.period)
        if self._worker is not None:
            self._job = self._worker.submit(think)
        else:
            self._bus.publish(topics.NAV_STEP, think(), t, self._latency)

    def _thought(self, dt: float) -> Callable[[], NavStep]:
        """Return what computes one step from what is known now."""
        status = self._legs.status
        T = HERE
        if self._frame == "map":
            place = self._bus.latest(topics.MAP_POSE)
            if place is None:
                raise StageFailed("navigate", "mapper", "The robot's place in the map is not known.")
            T = place.T_odom_map.to(HERE)
        grid, scan = self._bus.latest(topics.MAP), self._bus.latest(topics.SCAN)
        if self._frame == "map":
            if grid is not self._grid[0]:
                moved = None if grid is None else grid.in_map
                self._grid = grid, moved
            grid = self._grid[1]
            scan = None if scan is None else scan.seen_from(T)
        pose = T @ PlanarPose.of(self._legs.pose) @ status.rest
        inputs = NavInputs(pose, status.moving, grid, scan, self._room())
        goal, self._unstarted = self._unstarted, None

        def think() -> NavStep:
            if goal is not None:
                self._navigator.start(goal)
            return self._navigator.step(inputs, dt)

        return think

    def _room(self) -> Footprint | None:
        """Return the footprint of the robot, seen anew twice a second; None in a stack without LiDAR."""
        state = self._bus.latest(topics.LOW_STATE)
        if state is None or self._bus.latest(topics.SCAN) is None:
            return None
        if self._footprint is None or state.t >= self._footprint_due or state.t < self._footprint_due - 1.0:
            self._robot = self._robot or RobotFilter()
            self._footprint = Footprint.around(self._robot.balls(state.q), BODY_MARGIN)
            self._footprint_due = state.t + 0.5
        return self._footprint

    def _give_up(self, message: ModuleFaultMsg, t: float) -> None:
        self._bus.publish(topics.MODULE_FAULT, message, t)
        self._pursue(NavGoal(None))
        self._legs.drive(ZERO)
