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
from golem.capabilities.legs.base import Envelope, LowerBody
from golem.capabilities.localization.base import Localizer
from golem.capabilities.navigation.base import Navigator
from golem.errors import GolemError
from golem.hardware.estimator.base import BaseEstimator
from golem.hardware.estop.base import EmergencyStop
from golem.hardware.hands.base import HandController
from golem.hardware.safety.base import GateStatus, Request, SafetyLimits
from golem.hardware.servo.base import MotorServo
from golem.middleware import topics
from golem.middleware.bus import Bus
from golem.robots.base import Banded, Robot
from golem.robots.model.kinematics import Kinematics
from golem.robots.onboard import motion_switcher
from golem.robots.onboard.motion_switcher import MotionSwitcher
from golem.runtime import cameras, nodes
from golem.runtime.executor import Phase, Placed
from golem.runtime.guard import Guard
from golem.runtime.guarded import GuardedMethod, GuardedNavigator
from golem.runtime.legs import Legs, LowerBodyNode
from golem.runtime.onboard import BusOnboard, LocoServiceNode, ServiceNode
from golem.runtime.release import ReleaseNode
from golem.skills.base import Skill
from golem.skills.context import Context
from golem.skills.grasping.base import GraspMethod
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
class Workshop:
    """Makes the modules of a stack, each with the guard that watches it."""

    stack: Stack

    def make(self, slot: str, chosen: Choice | None = None, **context: object) -> tuple[Any, Guard]:
        """Return a new module for `slot`, by default the stack's choice, and its guard.

        Raises:
            ConfigError: a name or an option is wrong.
            ModuleFault: the constructor raised, or the module lacks a part of its contract.
        """
        choice = chosen or self.stack.choice(slot)
        guard = Guard(slot, choice.use)
        module = registry.create(slot, choice.use, choice.options, **context)
        guard.satisfies(module, CONTRACTS[slot])
        return module, guard


class RobotSide:
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
            ConfigError, ModuleFault: see `Workshop.make`; about the on-board legs.
        """
        guard = Guard("robot", stack.robot.use)
        self.act = nodes.ActNode(bus, robot, guard)
        self.nodes: list[Placed] = [(Phase.MEASURE, nodes.SenseNode(bus, robot, guard))]
        if wanted is not None:
            for name in robot.cameras:
                camera = cameras.CameraNode(bus, robot, name, wanted(name), guard)
                self.nodes.append((Phase.EXPOSE, camera))
        loco: LocoServiceNode | None = None
        if stack.legs_on_board is not None:
            legs = Legs(*Workshop(stack).make("lower_body", stack.legs_on_board))
            loco = LocoServiceNode(bus, stack.loco_api, legs)
            self.nodes.append((Phase.SERVE, loco))
        switcher = MotionSwitcher(None if loco is None else loco.service)
        self.nodes.append((Phase.SERVE, ServiceNode(bus, motion_switcher.SERVICE, switcher.answer)))
        self.nodes.append((Phase.ACT, self.act))


class SafetySide:
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

    def request(self, request: Request) -> None:
        """Ask something of the safety gate as an operator does: activate, stop, reset; it decides."""
        self.gate.request = request


class StackSide:
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
        band: Banded | None,
        latency: float,
        beside: ThreadPoolExecutor | None = None,
        real: bool = False,
    ) -> None:
        """Build the modules of `stack` around `bus`.

        Args:
            bus: where they meet.
            stack: which modules.
            calibration: of each camera; see `Robot.calibration`.
            band: what is let go once the robot stands, or None.
            latency: what a camera's frame takes on top of its way over the bus [s].
            beside: where the localizer runs; None is on the clock, see `LocalizerNode`.
            real: whether the robot is none of ours: no module can then call its on-board controller.

        Raises:
            ConfigError: a name or an option of the stack is wrong, or a module is to call a real robot's controller.
            ModuleFault: a module's constructor raised, or the module lacks a part of its contract.
        """
        self.stack, self.bus = stack, bus
        self._workshop = Workshop(stack)
        make = self._workshop.make
        self.context = Context(bus, Kinematics(), nodes.SkillNode.period)
        self._skills = nodes.SkillNode(self.context)
        # One for all goals: it may learn how these legs stop.
        self.navigator: Navigator = GuardedNavigator(*make("navigator"))
        estimator, estimator_guard = make("estimator")
        localizer, guard = make("localizer")
        lower_body = make("lower_body", onboard=None if real else BusOnboard(bus))
        reserve = make("lower_body", stack.legs_in_reserve, onboard=None if real else BusOnboard(bus))
        self.legs = LowerBodyNode(bus, Legs(*lower_body), Legs(*reserve))
        self.nodes: list[Placed] = [
            (Phase.ESTIMATE, nodes.EstimatorNode(bus, estimator, estimator_guard)),
            (Phase.PERCEIVE, cameras.FrameNode(bus, calibration, latency)),
            *(
                (Phase.PERCEIVE, cameras.LocalizerNode(bus, localizer, name, guard, beside))
                for name in calibration
            ),
            (Phase.DECIDE, self._skills),
            (Phase.CONTROL, self.legs),
            (Phase.CONTROL, nodes.UpperBodyNode(bus, *make("upper_body"))),
        ]
        for side in SIDES:
            hand, hand_guard = make("hand", side=side)
            self.nodes.append((Phase.CONTROL, nodes.HandNode(bus, hand, side, hand_guard)))
        self.nodes.append((Phase.CONTROL, nodes.ServoNode(bus, *make("servo"))))
        if band is not None:
            robot_guard = Guard("robot", stack.robot.use)
            self.nodes.append((Phase.OPERATE, ReleaseNode(bus, band, robot_guard, estimator_guard)))

    @property
    def method(self) -> GraspMethod:
        """The stack's grasp method, new and guarded."""
        return GuardedMethod(*self._workshop.make("grasp_method"))

    @property
    def safety(self) -> GateStatus | None:
        """The newest verdict of the safety gate."""
        return self.bus.latest(topics.SAFETY, GateStatus)

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
