"""Turns a stack file into a running stack: the composition root."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from golem import registry
from golem.capabilities.arms.base import UpperBody
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.legs.base import Envelope, LowerBody
from golem.capabilities.legs.hold import STANCES
from golem.capabilities.localization.base import Localizer
from golem.capabilities.navigation.base import Navigator
from golem.errors import ConfigError, GolemError, ModuleFault
from golem.hardware.estimator.base import BaseEstimator
from golem.hardware.estop.virtual import VirtualEstop
from golem.hardware.hands.base import HandController
from golem.hardware.safety.base import GateResult, GateState, Request, SafetyLimits
from golem.hardware.servo.base import MotorServo
from golem.middleware import topics
from golem.middleware.bus import Bus
from golem.middleware.unitree_api import LOCO_APIS
from golem.robots.base import Banded, Robot
from golem.robots.model.kinematics import Kinematics
from golem.robots.sensors.profiles import load_profile
from golem.runtime import nodes
from golem.runtime.executor import Executor, Node
from golem.runtime.guard import Guard
from golem.runtime.guarded import GuardedMethod, GuardedNavigator
from golem.runtime.legs import Legs, LowerBodyNode
from golem.runtime.onboard import BusOnboard, LocoServiceNode
from golem.runtime.release import ReleaseNode
from golem.skills.base import Skill, SkillResult
from golem.skills.context import Context
from golem.skills.grasping.base import GraspMethod
from golem.skills.runner import SkillRun
from golem.stack import Choice, Stack
from golem.types import LEGS, NUM_JOINTS, SIDES, UPPER, Array, Side

CAMERA_LATENCY = 0.033
"""Time from exposure to the frame being available [s]: one frame period of a D400 at 30 Hz."""
OPTICAL_FRAMES = {"head": "head_camera_optical"} | {f"{s}_hand": f"{s}_hand_camera_optical" for s in SIDES}
"""Frame of the nominal model per camera."""
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


class Running:
    """A stack in execution.

    Attributes:
        stack: what it was built from.
        bus: every stream.
        executor: the clock.
        estop: the virtual emergency stop, to be pressed.
    """

    def __init__(self, stack: Stack, robot: Robot) -> None:
        """Wire the modules of `stack` to `robot`.

        Raises:
            ConfigError: a name or an option of the stack is wrong.
            ModuleFault: a module's constructor raised, or the module lacks a part of its contract.
        """
        self.stack = stack
        self.bus = Bus()
        self.estop = VirtualEstop()
        self._safety = nodes.SafetyNode(self.bus, SafetyLimits.from_profile(stack.limits))
        self._act = nodes.ActNode(self.bus, robot, Guard("robot", stack.robot.use))
        context = Context(self.bus, Kinematics(), nodes.SkillNode.period)
        self._context = context
        self._skills = nodes.SkillNode(context)
        self.executor = Executor(self.bus, self._nodes(stack, robot))
        self._safety.request = Request.ACTIVATE

    @property
    def method(self) -> GraspMethod:
        """The stack's grasp method, new and guarded."""
        return GuardedMethod(*self._make("grasp_method"))

    @property
    def navigator(self) -> Navigator:
        """The stack's navigator, new and guarded."""
        return GuardedNavigator(*self._make("navigator"))

    def _make(self, slot: str, chosen: Choice | None = None, **context: object) -> tuple[Any, Guard]:
        """Return a new module for `slot`, by default the stack's choice, and the guard that watches it."""
        choice = chosen or self.stack.choice(slot)
        guard = Guard(slot, choice.use)
        module = registry.create(slot, choice.use, choice.options, **context)
        guard.satisfies(module, CONTRACTS[slot])
        return module, guard

    def _nodes(self, stack: Stack, robot: Robot) -> list[Node]:
        """Return the nodes in the order of one tick: measure, estimate, perceive, decide, control, protect, act."""
        bus, make = self.bus, self._make
        robot_guard = Guard("robot", stack.robot.use)
        localizer, localizer_guard = make("localizer")
        lower_body = make("lower_body", onboard=BusOnboard(bus))
        reserve = make("lower_body", stack.legs_in_reserve, onboard=BusOnboard(bus))
        self._legs = LowerBodyNode(bus, Legs(*lower_body), Legs(*reserve))
        out: list[Node] = [
            nodes.SenseNode(bus, robot, robot_guard),
            nodes.EstimatorNode(bus, *make("estimator")),
            nodes.EstopNode(bus, self.estop),
        ]
        for name in robot.cameras:
            optical = OPTICAL_FRAMES[name]
            out.append(nodes.CameraNode(bus, robot, name, optical, CAMERA_LATENCY, robot_guard))
            out.append(nodes.LocalizerNode(bus, localizer, name, localizer_guard))
        out.append(self._skills)
        if stack.legs_on_board is not None:
            legs = Legs(*make("lower_body", stack.legs_on_board))
            out.append(LocoServiceNode(bus, LOCO_APIS["h1"], legs))
        out.append(self._legs)
        out.append(nodes.UpperBodyNode(bus, *make("upper_body")))
        for side in SIDES:
            hand, guard = make("hand", side=side)
            out.append(nodes.HandNode(bus, hand, side, guard))
        out.append(nodes.ServoNode(bus, *make("servo")))
        out.append(self._safety)
        if isinstance(robot, Banded):
            out.append(ReleaseNode(bus, robot, robot_guard))
        out.append(self._act)
        return out

    @property
    def safety(self) -> GateResult | None:
        """The newest verdict of the safety gate."""
        return self.bus.latest(topics.SAFETY, GateResult)

    @property
    def envelope(self) -> Envelope:
        """The twists that the leg controller in charge can follow."""
        return self._legs.envelope

    def request(self, request: Request) -> None:
        """Ask something of the safety gate as an operator does: activate, stop, reset; it decides."""
        self._safety.request = request

    def start(self, skill: Skill[Context, Any], goal: object) -> SkillRun:
        """Start a skill; it advances with the executor.

        Raises:
            GolemError: another skill is still running.
        """
        if self._skills.run is not None and self._skills.run.result is None:
            raise GolemError("Another skill is running; cancel it first.")
        self._skills.run = SkillRun(skill.name, skill.run(self._context, goal))
        return self._skills.run

    def commanded(self, side: Side) -> Array:
        """Return the (4, 4) pose in odom that the hand on `side` is being sent to."""
        return self._context.arms[side].commanded

    def execute(
        self,
        skill: Skill[Context, Any],
        goal: object,
        timeout: float,
        realtime: bool = False,
        watch: Callable[[], None] = lambda: None,
    ) -> SkillResult:
        """Run a skill to its end in robot time.

        Args:
            skill: what to do.
            goal: its goal.
            timeout: robot time after which it is given up [s].
            realtime: pace by the wall clock.
            watch: called after every tick, for judges and viewers.

        Returns:
            The result; a safety stop or a timeout ends the skill with a result that says so. After a fault of the
            lower body the fallback gets the time to stand before this returns.
        """
        run = self.start(skill, goal)
        self._legs.realtime = realtime

        def over() -> bool:
            watch()
            ended = run.result is not None and not self._legs.recovering(self.executor.t)
            return ended or self._stopped()

        try:
            self.executor.run(self.executor.t + timeout, over, realtime)
        except BaseException:
            run.cancel()
            self.halt()
            raise
        if run.result is not None:
            return run.result
        run.cancel()
        safety = self.safety
        if self._stopped() and safety is not None:
            return SkillResult(False, "safety", "safety", f"Safety stop: {safety.reason}. {safety.detail}")
        return SkillResult(False, "timeout", None, f"Not done after {timeout:g} s of robot time.")

    def halt(self) -> None:
        """Stop the motors now, past every other module: the gate is asked to stop, and its damping command goes out."""
        self.request(Request.STOP)
        with suppress(ModuleFault):  # where the robot itself is what failed
            self._safety.step(self.executor.t)
            self._act.step(self.executor.t)

    def _stopped(self) -> bool:
        safety = self.safety
        return safety is not None and safety.state in (GateState.STOP1, GateState.STOP0)


def start_posture(on_ground: bool = False) -> Array:
    """Return the (27,) posture an episode starts in [rad]: arms at home, legs as they hang or as they stand."""
    q = np.zeros(NUM_JOINTS)
    q[LEGS] = np.tile(STANCES["crouch" if on_ground else "stand"], 2)
    q[UPPER] = POSTURES["home"]
    return q


def build(stack: Stack, seed: int) -> tuple[Running, Any]:
    """Build the robot of `stack` for episode `seed`, and the stack around it.

    Returns:
        The running stack, and the robot: for evaluation and viewers, never for modules.

    Raises:
        ConfigError: a name, an option, the profile or the seed is wrong.
        ModuleFault: a constructor raised, or a module lacks a part of its contract.
    """
    load_profile(stack.profile)
    if seed < 0:
        raise ConfigError(f"The seed is {seed}; it must be 0 or more.")
    choice, posture = stack.robot, start_posture(stack.on_ground)
    robot = registry.create(
        "robot", choice.use, choice.options, profile=stack.profile, seed=seed, posture=posture
    )
    Guard("robot", choice.use).satisfies(robot, Robot)
    return Running(stack, robot), robot
