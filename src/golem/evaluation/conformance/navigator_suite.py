"""What a navigator promises: see `golem.capabilities.navigation.base`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from golem.capabilities.navigation.base import Navigator, NavInputs
from golem.evaluation.conformance import samples
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.suite import Suite, check_fields
from golem.interfaces.nav_payloads import Nav2Reply, NavStep, OccupancyGrid, Scan
from golem.runtime.contract_check import ContractCheck
from golem.runtime.navigator_node import NavigatorNode
from golem.types import PlanarPose, Twist

MAX_RATE = 1.0 / NavigatorNode.period
"""Steps per second that a navigator may want [Hz]."""
GOAL = PlanarPose(1.0, 0.3, 0.4)
PATIENCE = 60.0
"""Time that a walk to a goal a metre away may take [s] [own]."""
RESTING = 600
"""Steps within which a navigator says of a robot that stands at its goal that it has arrived [own]."""
NEAR, TURNED = 0.1, 0.15
"""How far from the goal a robot that has arrived may stand [m], [rad] [own]."""

FLOOR = np.array([0.0, 0.0, -1.0])
"""Plane of the floor."""


class _ArrivedNav2:
    """See `golem.capabilities.navigation.nav2.Nav2Link`."""

    def send(self, pose: PlanarPose) -> None:
        """Take a goal."""

    def reply(self) -> Nav2Reply:
        """Say that the robot is there."""
        return Nav2Reply(1, "succeeded")

    def twist(self) -> None:
        """Command nothing."""
        return


class NavigatorInput(NamedTuple):
    """What it is shown, and where it shall go."""

    inputs: NavInputs
    goal: PlanarPose = GOAL


def at(pose: PlanarPose, moving: bool, goal: PlanarPose = GOAL, t: float = 0.1) -> NavigatorInput:
    """Return a robot at `pose` in an empty hall, with a scan of time `t` [s]."""
    grid, scan = surroundings(t)
    return NavigatorInput(NavInputs(pose, moving, grid, scan), goal)


def surroundings(t: float) -> tuple[OccupancyGrid, Scan]:
    """Return an empty map of 8 m with a wall parallel to the way at y = 2 m, and a scan of that wall at `t` [s]."""
    grid, scan = _hall()
    return grid, replace(scan, t=t)


@lru_cache(maxsize=1)
def _hall() -> tuple[OccupancyGrid, Scan]:
    t = 0.1
    cells = np.zeros((160, 160), dtype=np.int8)
    cells[120] = 100
    wall = np.stack((np.linspace(-2.0, 2.0, 80), np.full(80, 2.0), np.full(80, 0.5)), axis=1)
    return OccupancyGrid(t, PlanarPose(-4.0, -4.0, 0.0), 0.05, cells), Scan(t, wall, np.array([0.0, 0.0, 0.7]), FLOOR)


class NavigatorSuite(Suite):
    """Inputs are poses on the way to a goal, answers twists."""

    slot, contracts, forgets = "navigator", (Navigator,), False
    late = rated = True

    def context(self) -> Mapping[str, object]:
        """Return a Nav2 that has arrived as soon as it is asked: the rest is the navigator's."""
        return {"nav2": _ArrivedNav2()}

    def declared(self, contract: ContractCheck, module: Any) -> None:
        super().declared(contract, module)
        if module.rate > MAX_RATE:
            raise contract.fault(f"its rate is {module.rate:g} Hz, a navigator has at most {MAX_RATE:g} Hz")

    def inputs(self) -> Sequence[NavigatorInput]:
        """Return a robot on its way."""
        poses = (PlanarPose(0.004 * i, 0.001 * i, 0.02 * math.sin(0.2 * i)) for i in range(60))
        return [at(pose, i > 2, t=0.1 * (1 + i // 5)) for i, pose in enumerate(poses)]

    def edges(self) -> Mapping[str, Sequence[NavigatorInput]]:
        """Return goals where the robot is, behind it, far away, headings that wrap, and a map and scans."""
        here = PlanarPose(0.0, 0.0, 0.0)
        goals = {
            "a goal where the robot is": here,
            "a goal behind the robot": PlanarPose(-1.0, 0.0, math.pi),
            "a goal 1 km away": PlanarPose(1000.0, 0.0, 0.0),
        }
        cases = {what: [at(here, i > 2, goal) for i in range(20)] for what, goal in goals.items()}
        cases["a heading that wraps"] = [
            at(PlanarPose(0.0, 0.0, math.pi * (1 if i % 2 else -1)), True) for i in range(20)
        ]
        grid, scan = surroundings(0.1)
        cases["a wall next to the way"] = [NavigatorInput(NavInputs(here, i > 2, grid, scan)) for i in range(20)]
        cases["neither map nor scan"] = [NavigatorInput(NavInputs(here, i > 2)) for i in range(20)]
        cases["a scan without points"] = [
            NavigatorInput(NavInputs(here, False, None, Scan(0.1, np.zeros((0, 3)), np.zeros(3), FLOOR)))
        ]
        return cases

    def spoiled(self) -> Mapping[str, NavigatorInput]:
        return {"the pose": at(PlanarPose(samples.NAN, 0.0, 0.0), True)}

    def begin(self, module: Navigator, first: NavigatorInput) -> None:
        module.start(first.goal)

    def call(self, module: Navigator, given: NavigatorInput) -> NavStep:
        return module.step(given.inputs, self.dt)

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        contract.kind("the course", answer, NavStep)
        contract.kind("twist", answer.twist, Twist)
        check_fields(contract, answer.twist, vx=(), vy=(), wz=())
        contract.kind("arrived", answer.arrived, bool)
        contract.kind("left", answer.left, PlanarPose)
        if answer.failure is not None:
            contract.kind("failure", answer.failure, str)

    def _walk(self, candidate: Candidate) -> tuple[PlanarPose, list[NavStep]]:
        """Follow the twists of a new navigator until it says that it has arrived; return where that is."""
        module, contract = candidate.make(), candidate.contract
        contract.call(module.start, GOAL)
        pose, moving, answers = PlanarPose(0.0, 0.0, 0.0), False, list[NavStep]()
        for i in range(round(PATIENCE / self.dt)):
            # A new scan ten times a second, as a LiDAR has it.
            t = 0.1 * (1 + math.floor(10.0 * self.dt * i))
            answer = contract.call(self.call, module, at(pose, moving, t=t))
            answers.append(answer)
            if answer.ended:
                break
            v = answer.twist
            moving = v != Twist()
            pose = pose @ PlanarPose(v.vx * self.dt, v.vy * self.dt, v.wz * self.dt)
        return pose, answers

    @check
    def arrives(self, candidate: Candidate) -> None:
        """A robot that follows the twists exactly stands at the goal once it has arrived."""
        pose, answers = candidate.remember("walk", lambda: self._walk(candidate))
        if answers[-1].failure is not None:
            raise candidate.fault(f"a goal a metre away is given up: {answers[-1].failure}")
        if not answers[-1].arrived:
            raise candidate.fault(f"a goal a metre away is not reached in {PATIENCE:g} s")
        left = pose.to(GOAL)
        if math.hypot(left.x, left.y) > NEAR or abs(left.yaw) > TURNED:
            raise candidate.fault(
                f"it says that it has arrived {math.hypot(left.x, left.y):.3g} m and {abs(left.yaw):.3g} rad away"
            )

    @check
    def stands_where_it_has_arrived(self, candidate: Candidate) -> None:
        """Once arrived, the twist is zero."""
        _, answers = candidate.remember("walk", lambda: self._walk(candidate))
        if answers[-1].arrived and answers[-1].twist != Twist():
            raise candidate.fault(f"it has arrived and goes on at {answers[-1].twist}")

    @check
    def begins_again(self, candidate: Candidate) -> None:
        """A goal that is reached does not count for the next: it has not arrived where it has not been."""
        module = candidate.make()
        here = PlanarPose(0.0, 0.0, 0.0)
        self.run(candidate, [at(here, False, here)] * RESTING, module)
        answer = self.run(candidate, self.inputs()[:1], module)[0]
        if answer.arrived:
            raise candidate.fault("given another goal, it says at once that it has arrived")
