"""Modules that skills call, behind a guard: a user's may raise or return nonsense, and the fault carries its name."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from golem.capabilities.arms.base import check_pose
from golem.capabilities.arms.trajectory import check_trajectory
from golem.capabilities.grasping.base import Grasp, GraspMethod, Gripper, SeeingLaw, ServoLaw, ServoStatus, ServoStep
from golem.capabilities.memory.base import EVIDENCES, HasPlaces, Memory, MemoryFault, Observation, Place, When
from golem.capabilities.navigation.base import Navigator, NavInputs
from golem.capabilities.planning.base import NUM_JOINTS, ArmPlanner, Plan, PlanRefused, PlanRequest
from golem.capabilities.properties.base import Properties, PropertySource
from golem.errors import ConfigError
from golem.interfaces.nav_payloads import NavStep
from golem.interfaces.payloads import JointTrajectory
from golem.runtime.contract_check import ContractCheck
from golem.runtime.nodes import MIN_RATE
from golem.types import Array, LocalizedObject, PlanarPose, Side, Twist

T = TypeVar("T")


class CheckedGraspMethod:
    """A `GraspMethod` whose faults name the module."""

    def __init__(self, method: GraspMethod, contract: ContractCheck) -> None:
        self._method, self._contract = method, contract
        self.latency = contract.number("latency", method.latency, minimum=0.0)

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        grasps = self._contract.call(lambda: list(self._method.propose(target, scene, gripper)))
        for grasp in grasps:
            self._contract.kind("a proposal", grasp, Grasp)
            self._contract.array("T_odom_gripper", grasp.T_odom_gripper, 4, 4)
            self._contract.call(check_pose, "T_odom_gripper", grasp.T_odom_gripper)
            self._contract.number("gap", grasp.gap, minimum=0.0)
        return grasps

    def servo(self, target: LocalizedObject, grasp: Grasp, t: float) -> ServoLaw | None:
        law = self._contract.call(self._method.servo, target, grasp, t)
        if law is None:
            return None
        self._contract.satisfies(law, ServoLaw)
        if isinstance(law, SeeingLaw):
            return CheckedSeeingLaw(law, self._contract)
        return CheckedServoLaw(law, self._contract)


class CheckedServoLaw:
    """A `ServoLaw` whose faults name the module."""

    def __init__(self, law: ServoLaw, contract: ContractCheck) -> None:
        self._law, self._contract = law, contract
        self.label = law.label
        self.patience = contract.number("patience", law.patience, minimum=0.0)

    def step(self, t: float, sightings: list[LocalizedObject] | None, T_odom_gripper: Array) -> ServoStep:
        step = self._contract.call(self._law.step, t, sightings, T_odom_gripper)
        self._contract.kind("the servo step", step, ServoStep)
        self._contract.kind("status", step.status, ServoStatus)
        self._contract.array("T_odom_gripper", step.T_odom_gripper, 4, 4)
        self._contract.call(check_pose, "T_odom_gripper", step.T_odom_gripper)
        self._contract.array("target", step.target, 3)
        self._contract.number("sigma", step.sigma, minimum=0.0)
        return step


class CheckedSeeingLaw(CheckedServoLaw):
    """A `SeeingLaw` whose faults name the module."""

    def __init__(self, law: SeeingLaw, contract: ContractCheck) -> None:
        super().__init__(law, contract)
        self.cameras, self.width, self._see = law.cameras, law.width, law.see

    def see(
        self, t: float, side: Side, T_odom_base: Array, observe: Callable[[], dict[str, Any] | None], live: bool
    ) -> None:
        self._contract.call(self._see, t, side, T_odom_base, observe, live)


class CheckedPlanner:
    """An `ArmPlanner` whose faults name the module; what it refuses goes further as it is."""

    def __init__(self, planner: ArmPlanner, contract: ContractCheck) -> None:
        self._planner, self._contract = planner, contract
        self.latency = contract.number("latency", planner.latency, minimum=0.0)

    def plan(self, request: PlanRequest) -> Plan:
        plan = passing(self._contract, PlanRefused, lambda: self._planner.plan(request))
        self._contract.kind("the plan", plan, Plan)
        n = len(self._contract.array("times", plan.times, *np.shape(plan.times)))
        for name in ("q", "dq"):
            self._contract.array(name, getattr(plan, name), n, NUM_JOINTS)
        self._contract.call(check_trajectory, JointTrajectory(0.0, plan.times, plan.q, plan.dq), request.q)
        return plan


class CheckedProperties:
    """A `PropertySource` whose faults name the module; a name that it does not know is the user's error."""

    def __init__(self, source: PropertySource, contract: ContractCheck) -> None:
        self._source, self._contract = source, contract
        self.latency = contract.number("latency", source.latency, minimum=0.0)

    def properties(self, label: str) -> Properties:
        said = passing(self._contract, ConfigError, lambda: self._source.properties(label))
        return self._contract.kind("what it says", said, Properties)


class CheckedMemory:
    """A `Memory` whose faults name the module; what it refuses goes further as it is. Threads take turns."""

    def __init__(self, memory: Memory, contract: ContractCheck) -> None:
        self._memory, self._contract, self._turn = memory, contract, threading.Lock()

    @property
    def last(self) -> float:
        return float(self._contract.kind("last", self._memory.last, float))

    def observe(self, observation: Observation) -> None:
        self._ask(lambda: self._memory.observe(observation))

    def query(self, text: str, when: When = "now", at: float | None = None, limit: int = 5) -> list[Place]:
        places = self._ask(lambda: list(self._memory.query(text, when, at, limit)))
        for place in places:
            check_place(self._contract, place)
        return places

    def places(self, limit: int) -> list[Place]:
        """Return what is remembered; see `HasPlaces`. None of a memory that cannot say it."""
        memory = self._memory
        places = self._ask(lambda: list(memory.places(limit))) if isinstance(memory, HasPlaces) else []
        for place in places:
            check_place(self._contract, place)
        return places

    def forget(self, text: str) -> int:
        return self._contract.kind("the count", self._ask(lambda: self._memory.forget(text)), int)

    def close(self) -> None:
        self._ask(self._memory.close)

    def _ask(self, call: Callable[[], T]) -> T:
        with self._turn:
            return passing(self._contract, MemoryFault, call)


def check_place(contract: ContractCheck, place: object) -> None:
    """Check one answer of a memory. Raises ModuleFault: it is none."""
    found = contract.kind("a place", place, Place)
    contract.kind("label", found.label, str)
    contract.array("position", found.position, 3)
    if not 0.0 <= contract.number("score", found.score) <= 1.0:
        raise contract.fault(f"score is {found.score}, the contract asks for 0 to 1")
    if contract.number("last_seen", found.last_seen) < contract.number("first_seen", found.first_seen):
        raise contract.fault("a place was seen last before it was seen first")
    if found.evidence not in EVIDENCES:
        raise contract.fault(f"evidence is {found.evidence!r}, the contract asks for one of {EVIDENCES}")


def passing(contract: ContractCheck, refusal: type[Exception], call: Callable[[], T]) -> T:
    """Return `call()` of a module. Raises `refusal`, as its contract allows; ModuleFault: it raised anything else."""
    refused: list[Exception] = []

    def ask() -> T | None:
        try:
            return call()
        except refusal as reason:
            refused.append(reason)
            return None

    answer = contract.call(ask)
    if refused:
        raise refused[0]
    return cast("T", answer)


class CheckedNavigator:
    """A `Navigator` whose faults name the module."""

    def __init__(self, navigator: Navigator, contract: ContractCheck) -> None:
        self._navigator, self._contract = navigator, contract
        self.rate = contract.number("rate", navigator.rate, minimum=MIN_RATE)
        self.latency = contract.number("latency", navigator.latency, minimum=0.0)

    def start(self, goal: PlanarPose) -> None:
        self._contract.call(self._navigator.start, goal)

    def step(self, inputs: NavInputs, dt: float) -> NavStep:
        step = self._contract.call(self._navigator.step, inputs, dt)
        self._contract.kind("the step", step, NavStep)
        self._contract.kind("twist", step.twist, Twist)
        self._contract.kind("arrived", step.arrived, bool)
        self._contract.kind("left", step.left, PlanarPose)
        for name in ("vx", "vy", "wz"):
            self._contract.number(name, getattr(step.twist, name))
        for name in ("x", "y", "yaw"):
            self._contract.number(f"left.{name}", getattr(step.left, name))
        if step.failure is not None:
            self._contract.kind("failure", step.failure, str)
        return step
