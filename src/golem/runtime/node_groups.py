"""The three sides of a running robot: the robot itself, what protects it, and the stack that moves it.

In lock-step they share one process, one bus and one clock; live, each has its own. The nodes are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from golem import registry
from golem.capabilities.arms.base import UpperBody
from golem.capabilities.grasping.base import GraspMethod
from golem.capabilities.legs.base import Envelope, LowerBody
from golem.capabilities.navigation.base import Navigator
from golem.capabilities.perception.base import Localizer
from golem.errors import GolemError
from golem.hardware.estimator.base import BaseEstimator
from golem.hardware.estop.base import EmergencyStop
from golem.hardware.hands.base import HandController
from golem.hardware.safety.base import OperatorRequest, SafetyLimits
from golem.hardware.servo.base import MotorServo
from golem.interfaces import topics
from golem.interfaces.payloads import GateStatus
from golem.middleware.bus import Bus
from golem.robots.base import HasGantry, Robot
from golem.robots.model.kinematics import Kinematics
from golem.robots.unitree import motion_switcher
from golem.robots.unitree.motion_switcher import MotionSwitcher
from golem.runtime import nodes, perception_nodes
from golem.runtime.checked import CheckedGraspMethod, CheckedNavigator
from golem.runtime.contract_check import ContractCheck
from golem.runtime.executor import Phase, Placed
from golem.runtime.gantry_release import GantryReleaseNode
from golem.runtime.lower_body_node import CheckedLowerBody, LowerBodyNode
from golem.runtime.onboard_nodes import BusOnboard, LocoServiceNode, ServiceNode
from golem.skills.base import Skill
from golem.skills.context import Context
from golem.skills.runner import SkillRun
from golem.stack import Choice, Stack
from golem.types import SIDES, Array, Side

CONTRACTS: dict[str, type[Any]] = {
    "estimator": BaseEstimator,
    "servo": MotorServo,
    "hand": HandController,
    "lower_body": LowerBody,
    "upper_body": UpperBody,
    "localizer": Localizer,
    "grasp_method": GraspMethod,
    "navigator": Navigator,
}
"""What the module in a slot must have."""


@dataclass(frozen=True)
class ModuleFactory:
    """Makes the modules of a stack, each with the guard that watches it."""

    stack: Stack

    def make(self, slot: str, chosen: Choice | None = None, **context: object) -> tuple[Any, ContractCheck]:
        """Return a new module for `slot`, by default the stack's choice, and its guard.

        Raises:
            ConfigError: a name or an option is wrong.
            ModuleFault: the constructor raised, or the module lacks a part of its contract.
        """
        choice = chosen or self.stack.choice(slot)
        contract = ContractCheck(slot, choice.use)
        module = registry.create(slot, choice.use, choice.options, **context)
        contract.satisfies(module, CONTRACTS[slot])
        return module, contract


class RobotNodes:
    """The robot with its motors, IMU, hands, cameras and on-board computer.

    Attributes:
        nodes: its nodes.
        act: the one of them that lets time pass.
    """

    def __init__(
        self, bus: Bus, stack: Stack, robot: Robot, wanted: Callable[[str], Callable[[], bool]] | None
    ) -> None:
        """Connect `robot` to `bus`.

        Args:
            bus: where its nodes meet others.
            stack: what it was built from.
            robot: the robot.
            wanted: called with the name of a camera, returns what says whether it is to be exposed; None where that
                is another process's business.

        Raises:
            ConfigError, ModuleFault: see `ModuleFactory.make`; about the on-board legs.
        """
        contract = ContractCheck("robot", stack.robot.use)
        self.act = nodes.ActNode(bus, robot, contract)
        self.nodes: list[Placed] = [(Phase.MEASURE, nodes.SenseNode(bus, robot, contract))]
        if wanted is not None:
            for name in robot.cameras:
                camera = perception_nodes.CameraNode(bus, robot, name, wanted(name), contract)
                self.nodes.append((Phase.EXPOSE, camera))
        loco: LocoServiceNode | None = None
        if stack.legs_on_board is not None:
            legs = CheckedLowerBody(*ModuleFactory(stack).make("lower_body", stack.legs_on_board))
            loco = LocoServiceNode(bus, stack.loco_api, legs)
            self.nodes.append((Phase.SERVE, loco))
        switcher = MotionSwitcher(None if loco is None else loco.service)
        self.nodes.append((Phase.SERVE, ServiceNode(bus, motion_switcher.SERVICE, switcher.answer)))
        self.nodes.append((Phase.ACT, self.act))


class SafetyNodes:
    """The emergency stop and the gate.

    Attributes:
        nodes: its nodes.
        gate: the one of them that runs the gate.
    """

    def __init__(self, bus: Bus, limits: SafetyLimits, estop: EmergencyStop | None) -> None:
        """Enforce `limits`, under `estop`; without one the gate stays shut."""
        self.gate = nodes.SafetyNode(bus, limits)
        self.nodes: list[Placed] = [(Phase.PROTECT, self.gate)]
        if estop is not None:
            self.nodes.insert(0, (Phase.PROTECT, nodes.EstopNode(bus, estop)))

    def request(self, request: OperatorRequest) -> None:
        """Ask something of the safety gate as an operator does: activate, stop, reset; it decides."""
        self.gate.request = request


class StackNodes:
    """Everything that decides what the robot does.

    Attributes:
        stack: what it was built from.
        bus: its streams.
        nodes: its nodes.
        legs: the one of them that runs the leg controller.
        context: what its skills work with.
    """

    def __init__(
        self,
        bus: Bus,
        stack: Stack,
        calibration: Mapping[str, Array],
        gantry: HasGantry | None,
        latency: float,
        pool: ThreadPoolExecutor | None = None,
        real: bool = False,
    ) -> None:
        """Build the modules of `stack` around `bus`.

        Args:
            bus: where they meet.
            stack: which modules.
            calibration: of each camera; see `Robot.calibration`.
            gantry: what is let go once the robot stands, or None.
            latency: what a camera's frame takes on top of its way over the bus [s].
            pool: where the localizer runs; None is on the clock, see `LocalizerNode`.
            real: whether the robot is none of ours: no module can then call its on-board controller.

        Raises:
            ConfigError: a name or an option of the stack is wrong, or a module is to call a real robot's controller.
            ModuleFault: a module's constructor raised, or the module lacks a part of its contract.
        """
        self.stack, self.bus = stack, bus
        self._workshop = ModuleFactory(stack)
        make = self._workshop.make
        self.context = Context(bus, Kinematics(), nodes.SkillNode.period)
        self._skills = nodes.SkillNode(self.context)
        # One for all goals: it may learn how these legs stop.
        self.navigator: Navigator = CheckedNavigator(*make("navigator"))
        estimator, estimator_contract = make("estimator")
        localizer, contract = make("localizer")
        lower_body = make("lower_body", onboard=None if real else BusOnboard(bus))
        reserve = make("lower_body", stack.legs_in_reserve, onboard=None if real else BusOnboard(bus))
        self.legs = LowerBodyNode(bus, CheckedLowerBody(*lower_body), CheckedLowerBody(*reserve))
        self.nodes: list[Placed] = [
            (Phase.ESTIMATE, nodes.EstimatorNode(bus, estimator, estimator_contract)),
            (Phase.PERCEIVE, perception_nodes.ImagePoseNode(bus, calibration, latency)),
            *(
                (Phase.PERCEIVE, perception_nodes.LocalizerNode(bus, localizer, name, contract, pool))
                for name in calibration
            ),
            (Phase.DECIDE, self._skills),
            (Phase.CONTROL, self.legs),
            (Phase.CONTROL, nodes.UpperBodyNode(bus, *make("upper_body"))),
        ]
        for side in SIDES:
            hand, hand_contract = make("hand", side=side)
            self.nodes.append((Phase.CONTROL, nodes.HandNode(bus, hand, side, hand_contract)))
        self.nodes.append((Phase.CONTROL, nodes.ServoNode(bus, *make("servo"))))
        if gantry is not None:
            robot_contract = ContractCheck("robot", stack.robot.use)
            self.nodes.append(
                (Phase.OPERATE, GantryReleaseNode(bus, gantry, robot_contract, estimator_contract))
            )

    @property
    def method(self) -> GraspMethod:
        """The stack's grasp method, new and guarded."""
        return CheckedGraspMethod(*self._workshop.make("grasp_method"))

    @property
    def safety(self) -> GateStatus | None:
        """The newest verdict of the safety gate."""
        return self.bus.latest(topics.SAFETY)

    @property
    def stopped(self) -> bool:
        """Whether the safety gate has stopped the robot."""
        safety = self.safety
        return safety is not None and safety.stopped

    @property
    def envelope(self) -> Envelope:
        """The twists that the leg controller in charge can follow."""
        return self.legs.envelope

    def start(self, skill: Skill[Context, Any], goal: object) -> SkillRun:
        """Start a skill; it advances with the executor.

        Raises:
            GolemError: another skill is still running.
        """
        if self._skills.run is not None and self._skills.run.result is None:
            raise GolemError("Another skill is running; cancel it first.")
        self.context.release_arms()
        self._skills.run = SkillRun(skill.name, skill.run(self.context, goal))
        return self._skills.run

    def commanded(self, side: Side) -> Array:
        """Return the (4, 4) pose in odom that the hand on `side` is being sent to."""
        return self.context.arms[side].commanded
