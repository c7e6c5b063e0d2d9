"""The navigator has its turn after the skill: its newest step drives the legs, late by what it declares."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from tests.skills.conftest import modules

from golem.capabilities.navigation.base import NavInputs
from golem.errors import MissingExtra
from golem.interfaces import topics
from golem.interfaces.nav_payloads import NavGoal, NavStep, OccupancyGrid, Scan
from golem.interfaces.payloads import LegStatus, Odometry
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.runtime.checked import CheckedNavigator
from golem.runtime.contract_check import ContractCheck
from golem.runtime.navigator_node import NavigatorNode
from golem.skills.context import Context
from golem.types import PlanarPose, Twist

HERE = PlanarPose(0.0, 0.0, 0.0)
AHEAD = PlanarPose(1.0, 0.0, 0.0)
PERIOD = NavigatorNode.period


class Counts:
    """A navigator that drives as many cm/s as it was asked for steps."""

    def __init__(self, rate: float = 100.0, latency: float = 0.0) -> None:
        self.rate, self.latency = rate, latency
        self.goals: list[PlanarPose] = []
        self.given: list[tuple[NavInputs, float]] = []
        self.says: NavStep | Exception | None = None
        self.gate = threading.Event()
        self.gate.set()

    def start(self, goal: PlanarPose) -> None:
        self.goals.append(goal)

    def step(self, inputs: NavInputs, dt: float) -> NavStep:
        assert self.gate.wait(30.0)
        self.given.append((inputs, dt))
        if isinstance(self.says, Exception):
            raise self.says
        return self.says or NavStep(Twist(len(self.given) / 100.0), False, AHEAD)


class Rig:
    """A node around a navigator. The robot is in the origin and would come to rest half a metre ahead."""

    def __init__(self, navigator: Counts, pool: ThreadPoolExecutor | None = None) -> None:
        self.bus, self.navigator = Bus(), navigator
        self.context = Context(self.bus, Kinematics(), PERIOD, modules())
        contract = ContractCheck("navigator", "mine.py:Mine")
        checked = CheckedNavigator(navigator, contract)
        self.node = NavigatorNode(self.bus, checked, contract, self.context.legs, pool)
        rest = PlanarPose(0.5, 0.0, 0.0)
        still = LegStatus(0.0, Twist(), Twist(), False, "", False, True, rest, np.zeros(2), "almi")
        self.bus.publish(topics.LEG_STATUS, still, 0.0)

    def go(self, goal: PlanarPose | None) -> None:
        self.bus.publish(topics.NAV_GOAL, NavGoal(goal), self.context.t)

    def ticks(self, count: int) -> list[float]:
        """Return the speed ahead the legs were told at each tick; nan where they were told nothing."""
        told: list[float] = []
        for _ in range(count):
            self.context.t += PERIOD
            self.bus.deliver(self.context.t)
            before = self.bus.count(topics.TWIST)
            self.node.step(self.context.t)
            twist = self.bus.latest(topics.TWIST)
            told.append(np.nan if twist is None or self.bus.count(topics.TWIST) == before else twist.vx)
        return told


def test_nobody_moves_without_a_goal() -> None:
    rig = Rig(Counts())
    assert np.isnan(rig.ticks(5)).all() and rig.navigator.given == []


def test_a_step_drives_the_legs_in_the_tick_of_its_goal() -> None:
    rig = Rig(Counts())
    rig.go(AHEAD)
    assert rig.ticks(3) == [0.01, 0.02, 0.03]
    assert rig.navigator.goals == [AHEAD]
    inputs, dt = rig.navigator.given[0]
    assert (inputs.pose.x, inputs.moving, inputs.grid, inputs.scan, dt) == (0.5, True, None, None, PERIOD)
    rig.go(None)
    assert np.isnan(rig.ticks(3)).all()


def test_between_two_steps_of_a_slow_one_the_newest_twist_holds() -> None:
    rig = Rig(Counts(rate=25.0))
    rig.go(AHEAD)
    assert rig.ticks(9) == [0.01] * 4 + [0.02] * 4 + [0.03]
    assert [dt for _, dt in rig.navigator.given] == pytest.approx([0.04] * 3)


def test_a_latency_delays_every_step_and_a_new_goal_hears_no_old_one() -> None:
    rig = Rig(Counts(latency=0.03))
    rig.go(AHEAD)
    assert np.nan_to_num(rig.ticks(6)).tolist() == [0.0, 0.0, 0.0, 0.01, 0.02, 0.03]
    rig.go(HERE)
    assert np.nan_to_num(rig.ticks(4)).tolist() == [0.0, 0.0, 0.0, 0.07]
    assert rig.navigator.goals == [AHEAD, HERE]


def test_map_and_scan_are_shown_where_there_are_any() -> None:
    rig = Rig(Counts())
    grid = OccupancyGrid(0.0, HERE, 0.05, np.zeros((2, 3), np.int8))
    scan = Scan(0.0, np.zeros((4, 3)), np.zeros(3), np.zeros(3))
    rig.bus.publish(topics.MAP, grid, 0.0)
    rig.bus.publish(topics.SCAN, scan, 0.0)
    rig.go(AHEAD)
    rig.ticks(1)
    inputs, _ = rig.navigator.given[0]
    assert inputs.grid is grid and inputs.scan is scan


@pytest.mark.parametrize("step", [NavStep(Twist(0.5), True, HERE), NavStep.failed("A wall is in the way.", AHEAD)])
def test_who_has_arrived_or_given_up_stands(step: NavStep) -> None:
    rig = Rig(Counts())
    rig.navigator.says = step
    rig.go(AHEAD)
    assert rig.ticks(2) == [0.0, 0.0]
    assert rig.bus.latest(topics.NAV_STEP) is step


def test_a_fault_is_told_by_name_and_stops_the_robot() -> None:
    rig = Rig(Counts())
    rig.go(AHEAD)
    rig.ticks(2)
    rig.navigator.says = ValueError("no way")
    assert np.nan_to_num(rig.ticks(3), nan=9.0).tolist() == [0.0, 9.0, 9.0]
    fault = rig.bus.latest(topics.MODULE_FAULT)
    assert fault is not None and fault.slot == "navigator"
    assert "mine.py:Mine failed: ValueError: no way" in fault.reason


def test_a_robot_that_is_lost_is_told_as_the_odometrys() -> None:
    rig = Rig(Counts())
    rig.bus.publish(topics.ODOMETRY, Odometry(-1.0, np.eye(4)), 0.0)
    rig.go(AHEAD)
    assert rig.ticks(1) == [0.0]
    fault = rig.bus.latest(topics.MODULE_FAULT)
    assert fault is not None and (fault.slot, fault.stage) == ("odometry", "walk")


def test_what_this_machine_lacks_ends_a_lockstep_run_and_live_the_skill() -> None:
    lack = MissingExtra("nav2", "ros")
    rig = Rig(Counts())
    rig.navigator.says = lack
    rig.go(AHEAD)
    with pytest.raises(MissingExtra):
        rig.ticks(1)
    with ThreadPoolExecutor(1) as pool:
        rig = Rig(Counts(), pool)
        rig.navigator.says = lack
        rig.go(AHEAD)
        assert rig.ticks(1) == [0.0]
        assert rig.bus.latest(topics.MODULE_FAULT) is not None


def test_one_that_takes_its_time_stops_no_clock() -> None:
    with ThreadPoolExecutor(1) as pool:
        rig = Rig(Counts(latency=0.2), pool)
        rig.navigator.gate.clear()
        rig.go(AHEAD)
        assert np.isnan(rig.ticks(50)).all()
        rig.go(HERE)  # whatever the first goal's step says is void
        assert np.isnan(rig.ticks(50)).all()
        rig.navigator.gate.set()
        pool.submit(lambda: None).result()
        assert rig.ticks(1) == [0.02]
    assert rig.navigator.goals == [AHEAD, HERE]
