"""The three sides of a running robot: the robot itself, what protects it, and the stack that moves it.

In lock-step they share one process, one bus and one clock; live, each has its own. The nodes are the same.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from golem import registry
from golem.capabilities.legs.base import Envelope
from golem.errors import GolemError
from golem.hardware.estop.base import EmergencyStop
from golem.hardware.safety.base import OperatorRequest, SafetyLimits
from golem.hardware.safety.standing_gate import StandingController
from golem.interfaces import topics
from golem.interfaces.payloads import GateStatus
from golem.middleware.bus import Bus
from golem.robots.base import HasGantry, HasLidar, Robot
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.unitree import loco_service
from golem.robots.unitree.loco_service import MotionSwitcher
from golem.runtime import nodes, perception_nodes, robot_nodes, safety_nodes
from golem.runtime.checked import CheckedGraspMethod, CheckedMemory, CheckedNavigator, CheckedPlanner, CheckedProperties
from golem.runtime.contract_check import ContractCheck
from golem.runtime.executor import Phase, Placed
from golem.runtime.lower_body_node import CheckedLowerBody, LowerBodyNode
from golem.runtime.navigator_node import BusNav2, NavigatorNode
from golem.runtime.odometry_node import LidarNode, MapperNode, OdometryNode, ScanNode
from golem.runtime.onboard_nodes import BusOnboard, LocoServiceNode, ServiceNode, stack_loco_api
from golem.runtime.perception_nodes import MemoryNode
from golem.runtime.skill_table import SkillTable
from golem.runtime.standing_legs import GantryReleaseNode
from golem.skills.base import Routine
from golem.skills.context import Context, Modules
from golem.skills.pursuit import pursue
from golem.skills.runner import SkillRun
from golem.skills.spec import as_goal
from golem.slots import KEYS
from golem.stack import SCAN, Stack
from golem.types import SIDES, Array, Side

LEGS_ALONE = ("legs",)
"""What an odometry goes by that knows no more than the base estimate, by which skills go without it."""
POOLED = ("localizer", "grasp_method", "navigator", "memory")
"""Slots whose modules may take longer than a tick: live, each thinks on a thread of its own, beside the clock."""


@dataclass(frozen=True)
class ModuleFactory:
    """Makes the modules of a stack, each with the guard that watches it."""

    stack: Stack

    def make(self, key: str, **context: object) -> tuple[Any, ContractCheck]:
        """Return a new module, what the stack chooses under `key`, and its guard.

        Raises:
            ConfigError: a name or an option is wrong.
            ModuleFault: the constructor raised, or the module lacks a part of its contract.
        """
        choice, slot = self.stack.choice(key), KEYS[key].slot
        contract = ContractCheck(slot, choice.use)
        module = registry.create(slot, choice.use, choice.options, **context)
        contract.satisfies(module, registry.contract(slot))
        return module, contract


def hears_lidar(stack: Stack) -> bool:
    """Return whether the odometry or the navigator of `stack` needs the LiDAR. Raises as `registry.load` does."""
    sources = getattr(registry.load("odometry", stack.choice("odometry").use), "sources", ())
    return bool({"imu", "scan"} & set(sources)) or SCAN in registry.requires("navigator", stack.choice("navigator").use)


class RobotNodes:
    """The robot with motors, IMU, hands, cameras and on-board computer; its node `act` lets time pass."""

    def __init__(
        self,
        bus: Bus,
        stack: Stack,
        robot: Robot,
        wanted: Callable[[str], Callable[[], bool]] | None,
        lidar_wanted: Callable[[], bool] | None,
        joint_offset: Array | None = None,
    ) -> None:
        """Connect `robot` to `bus`. Raises ConfigError, ModuleFault: see `ModuleFactory.make`; about the on-board legs.

        Args:
            wanted: called with the name of a camera, returns what says whether it is to be exposed; None where that
                is another process's business.
            lidar_wanted: says whether anybody listens to the LiDAR; None where nobody ever does.
            joint_offset: (27,) reported minus true joint positions by calibration [rad]; None believes them.
        """
        contract = ContractCheck("robot", stack.choice("robot").use)
        self.act = robot_nodes.ActNode(bus, robot, contract, joint_offset)
        self.nodes: list[Placed] = [(Phase.MEASURE, robot_nodes.SenseNode(bus, robot, contract, joint_offset))]
        if wanted is not None:
            for name in robot.cameras:
                camera = perception_nodes.CameraNode(bus, robot, name, wanted(name), contract)
                self.nodes.append((Phase.EXPOSE, camera))
        if isinstance(robot, HasLidar) and lidar_wanted is not None:
            self.nodes.append((Phase.EXPOSE, LidarNode(bus, robot, lidar_wanted, contract)))
        loco: LocoServiceNode | None = None
        if stack.legs_on_board is not None:
            legs = CheckedLowerBody(*ModuleFactory(stack).make("onboard"), stack.on_ground)
            loco = LocoServiceNode(bus, stack_loco_api(stack), legs, stack.part("locomotion"))
            self.nodes.append((Phase.SERVE, loco))
        switcher = MotionSwitcher(None if loco is None else loco.service)
        self.nodes.append((Phase.SERVE, ServiceNode(bus, loco_service.SERVICE, switcher.answer)))
        self.nodes.append((Phase.ACT, self.act))


class SafetyNodes:
    """The emergency stop and the gate; the node `gate` runs the latter."""

    def __init__(
        self,
        bus: Bus,
        limits: SafetyLimits,
        estop: EmergencyStop | None,
        standing: Callable[[], StandingController] | None = None,
    ) -> None:
        """Enforce `limits`, under `estop`; without one the gate stays shut. `standing`: see `StandingGate`."""
        self.gate = safety_nodes.SafetyNode(bus, limits, standing)
        self.nodes: list[Placed] = [(Phase.PROTECT, self.gate)]
        if estop is not None:
            self.nodes.append((Phase.RECEIVE, safety_nodes.EstopNode(bus, estop)))

    def request(self, request: OperatorRequest) -> None:
        """Ask something of the safety gate as an operator does: activate, stop, reset; it decides."""
        self.gate.request = request


class StackNodes:
    """Everything that decides what the robot does.

    Attributes:
        legs: the one of them that runs the leg controller.
        running: the one of its nodes that resumes the skill that runs.
        memory: what it remembers; closed with `close` before another stack opens its file.
        remembering: the one of its nodes that feeds it.
    """

    def __init__(
        self,
        bus: Bus,
        stack: Stack,
        calibration: Mapping[str, Array],
        mount: Array | None,
        gantry: HasGantry | None,
        latency: float,
        pools: Mapping[str, ThreadPoolExecutor] | None = None,
        real: bool = False,
        epoch: float = 0.0,
    ) -> None:
        """Build the modules of `stack` around `bus`.

        Args:
            calibration: of each camera; see `Robot.calibration`.
            mount: (4, 4) pose of the LiDAR by calibration; None is that of the nominal model.
            gantry: what is let go once the robot stands, or None.
            latency: what a camera's frame takes on top of its way over the bus [s].
            pools: where the modules of the slots `POOLED` run; None is on the clock, see `LocalizerNode`.
            real: whether the robot is none of ours: no module can then call its on-board controller.
            epoch: when the robot's clock was at 0, in Unix time [s]: what is remembered outlives that clock.

        Raises:
            ConfigError: a name or an option of the stack is wrong, or a module is to call a real robot's controller.
            ModuleFault: a module's constructor raised, or the module lacks a part of its contract.
        """
        stack.check()
        pools = pools or {}
        self.stack, self.bus = stack, bus
        make = ModuleFactory(stack).make
        self.skills = SkillTable(stack)
        navigator, navigator_contract = make("navigator", nav2=BusNav2(bus))
        estimator, estimator_contract = make("estimator")
        odometry, odometry_contract = make("odometry")
        mapper, mapper_contract = make("mapper")
        eyes, contract = make("localizer")
        legs, reserve = (
            CheckedLowerBody(*make(key, onboard=None if real else BusOnboard(bus)), stack.on_ground)
            for key in ("lower_body", "fallback")
        )
        self.legs = LowerBodyNode(bus, legs, reserve, stack.part("locomotion"))
        self.memory = CheckedMemory(*make("memory"))
        modules = Modules(
            memory=self.memory,
            grasp_method=lambda: CheckedGraspMethod(*make("grasp_method")),
            skill=self.skills.make,
            planner=functools.cache(lambda: CheckedPlanner(*make("planner"))),
            properties=CheckedProperties(*make("properties")),
            worker=pools.get("grasp_method"),
        )
        self.context = Context(bus, Kinematics(), nodes.SkillNode.period, modules)
        self.running = nodes.SkillNode(self.context)
        self.nodes: list[Placed] = [
            (Phase.ESTIMATE, nodes.EstimatorNode(bus, estimator, estimator_contract)),
            (Phase.PERCEIVE, perception_nodes.ImagePoseNode(bus, calibration, latency)),
            *(
                (Phase.PERCEIVE, perception_nodes.LocalizerNode(bus, eyes, name, contract, pools.get("localizer")))
                for name in calibration
            ),
            (Phase.DECIDE, self.running),
            (
                Phase.DECIDE,
                NavigatorNode(
                    bus,
                    CheckedNavigator(navigator, navigator_contract),
                    navigator_contract,
                    self.context.legs,
                    pools.get("navigator"),
                ),
            ),
            (Phase.CONTROL, self.legs),
            (Phase.CONTROL, nodes.UpperBodyNode(bus, *make("upper_body"))),
        ]
        lidar, pool = hears_lidar(stack), pools.get("memory")
        self.remembering = MemoryNode(bus, self.memory, calibration, lidar, epoch, pool)
        self.nodes.append((Phase.PERCEIVE, self.remembering))
        if tuple(odometry.sources) != LEGS_ALONE or hears_lidar(stack):
            self.nodes.append((Phase.PERCEIVE, OdometryNode(bus, odometry, odometry_contract, mount)))
        if hears_lidar(stack):
            self.nodes.append((Phase.PERCEIVE, ScanNode(bus, mount)))
            self.nodes.append((Phase.PERCEIVE, MapperNode(bus, mapper, mapper_contract)))
        for side in SIDES:
            hand, hand_contract = make("hand", side=side)
            self.nodes.append((Phase.CONTROL, nodes.HandNode(bus, hand, side, hand_contract)))
        self.nodes.append((Phase.CONTROL, nodes.ServoNode(bus, *make("servo"))))
        if gantry is not None:
            robot_contract = ContractCheck("robot", stack.choice("robot").use)
            self.nodes.append((Phase.OPERATE, GantryReleaseNode(bus, gantry, robot_contract, estimator_contract)))

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

    def start(self, skill: str | Routine[Context, Any], goal: object, timeout: float | None = None) -> SkillRun:
        """Start a skill; it advances with the executor.

        Args:
            skill: name of one of the stack's, or one that the stack does not know.
            goal: its goal, or the fields of one of the stack's skills.
            timeout: robot time after which it is cancelled [s]; by default what the skill itself allows, and for one
                that the stack does not know without end.

        Raises:
            GolemError: another skill is still running.
            ConfigError: there is no skill of that name, or the goal is none of it.
            ModuleFault: the skill's constructor raised.
        """
        if self.busy:
            raise GolemError("Another skill is running; cancel it first.")
        if isinstance(skill, str):
            name, routine = skill, self.skills.make(skill)
            goal = as_goal(name, routine.Goal, goal)
        else:
            name, routine, timeout = type(skill).__name__.lower(), skill, timeout or math.inf
        self.context.release_arms()
        self.running.run = SkillRun(name, pursue(self.context, name, routine, goal, timeout))
        return self.running.run

    @property
    def busy(self) -> bool:
        """Whether a skill is running."""
        return self.running.run is not None and self.running.run.result is None

    def cancel(self) -> None:
        """Cancel the skill that runs, if one does; it may take a while to leave the robot safe."""
        if self.running.run is not None:
            self.running.run.cancel()

    def commanded(self, side: Side) -> Array:
        """Return the (4, 4) pose in odom that the hand on `side` is being sent to."""
        return self.context.arms[side].commanded
