"""Turns a stack file into a running stack in lock-step: the three sides in one process, on one bus and one clock."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from golem import registry
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.legs.hold import STANCES
from golem.errors import ConfigError, ModuleFault, RobotGone
from golem.hardware.estop.estop_config import VirtualEstop
from golem.hardware.safety.base import OperatorRequest, SafetyLimits
from golem.middleware.bus import Bus
from golem.robots.base import HasGantry, HasLivingSensors, Robot
from golem.robots.sensors.profiles import load_profile
from golem.runtime.chain import chain_of
from golem.runtime.contract_check import ContractCheck
from golem.runtime.executor import FOREVER, Executor, in_order, when_stepped
from golem.runtime.node_groups import RobotNodes, SafetyNodes, StackNodes, hears_lidar
from golem.runtime.perception_nodes import LATENCY, detection_requested
from golem.runtime.standing_legs import StandingLegs
from golem.skills.base import Routine, SkillResult
from golem.skills.context import Context
from golem.stack import Stack
from golem.types import LEGS, NUM_JOINTS, UPPER, Array


class LockstepRunner(StackNodes):
    """A stack in execution, with its robot and gate; `estop` is the virtual emergency stop, to be pressed."""

    def __init__(self, stack: Stack, robot: Robot, limits: SafetyLimits | None = None) -> None:
        """Wire the modules of `stack` to `robot`. Raises ConfigError, ModuleFault: see `StackNodes`.

        What the safety gate enforces instead of the stack's profile, in studies of the gate, are `limits`.
        """
        if stack.part("estop").use != "virtual":
            raise ConfigError(
                "A board as emergency stop is for 'golem launch' and 'golem safety'; "
                "in lock-step estop.use is 'virtual'."
            )
        bus, self.estop = Bus(), VirtualEstop()
        gantry = robot if isinstance(robot, HasGantry) and robot.on_gantry else None
        lidar = hears_lidar(stack)
        seen = partial(detection_requested, bus)
        calibration = stack.part("calibration").load()
        offset = calibration.joint_offset if calibration.joint_offset.any() else None
        self._robot = RobotNodes(bus, stack, robot, seen, (lambda: True) if lidar else None, offset)
        limits = limits or SafetyLimits.from_profile(stack.limits)
        if not isinstance(robot, HasLivingSensors):
            limits = limits.believing()
        elif not robot.living:
            limits = limits.still()
        standing = StandingLegs if stack.on_ground else None
        self._safety = SafetyNodes(bus, limits, self.estop, standing)
        super().__init__(bus, stack, calibration.merged(robot.calibration), calibration.mount, gantry, LATENCY)
        ordered = in_order(self._robot.nodes + self._safety.nodes + self.nodes)
        self.executor = Executor(bus, ordered, chain=chain_of(bus, ordered))
        self.request(OperatorRequest.ACTIVATE)

    def sleep(self, seconds: float) -> None:
        """Let time pass for the memory alone: a day, as if the robot had been off."""
        self.remembering.sleep(seconds, self.executor.t)

    def request(self, request: OperatorRequest) -> None:
        """Ask something of the safety gate as an operator does: activate, stop, reset; it decides."""
        self._safety.request(request)

    def execute(
        self,
        skill: str | Routine[Context, Any],
        goal: object,
        timeout: float | None = None,
        realtime: bool = False,
        watch: Callable[[], None] | None = None,
    ) -> SkillResult:
        """Run a skill to its end in robot time.

        Args:
            skill: name of one of the stack's, or one that the stack does not know.
            goal: its goal, or the fields of one of the stack's skills.
            timeout: robot time after which it is given up [s]; see `StackNodes.start`.
            realtime: pace by the wall clock.
            watch: called after every tick, for judges and viewers. One with a method `due` says until when it may be
                left out, see `Executor.run`.

        Returns:
            The result; a safety stop, a timeout or the end of a recording that stands in for the robot ends the skill
            with a result that says so. After a fault of the lower body the fallback gets the time to stand before
            this returns.
        """
        run = self.start(skill, goal, timeout)
        self.legs.realtime = realtime

        def over() -> bool:
            if watch is not None:
                watch()
            ended = run.result is not None and not self.legs.recovering(self.executor.t)
            return ended or self.stopped

        try:
            due = when_stepped if watch is None else getattr(watch, "due", None)
            self.executor.run(FOREVER, over, realtime, due)
        except RobotGone as gone:
            result = run.result
            run.cancel()
            return result or SkillResult(False, "robot", "robot", str(gone))
        except BaseException:
            run.cancel()
            self.halt()
            raise
        if run.result is not None:
            return run.result
        run.cancel()
        why = "" if self.safety is None else self.safety.why
        return SkillResult(False, "safety", "safety", f"Safety stop: {why}.")

    def halt(self) -> None:
        """Stop the motors now, past every other module: the gate is asked to stop, and its damping command goes out."""
        self.request(OperatorRequest.STOP)
        with suppress(ModuleFault):  # where the robot itself is what failed
            self._safety.gate.step(self.executor.t)
            self._robot.act.step(self.executor.t)


def start_posture(on_ground: bool = False) -> Array:
    """Return the (27,) posture an episode starts in [rad]: arms at home, legs as they hang or as they stand."""
    q = np.zeros(NUM_JOINTS)
    q[LEGS] = np.tile(STANCES["crouch" if on_ground else "stand"], 2)
    q[UPPER] = POSTURES["home"]
    return q


def build_robot(stack: Stack, seed: int) -> Any:
    """Build the robot of `stack` for episode `seed`.

    Raises:
        ConfigError: a name, an option, the profile or the seed is wrong.
        ModuleFault: its constructor raised, or it lacks a part of its contract.
    """
    load_profile(stack.profile)
    if seed < 0:
        raise ConfigError(f"The seed is {seed}; it must be 0 or more.")
    choice, posture = stack.choice("robot"), start_posture(stack.on_ground)
    robot = registry.create("robot", choice.use, choice.options, profile=stack.profile, seed=seed, posture=posture)
    ContractCheck("robot", choice.use).satisfies(robot, Robot)
    return robot


def build(stack: Stack, seed: int, limits: SafetyLimits | None = None) -> tuple[LockstepRunner, Any]:
    """Return `stack` running for episode `seed`, and its robot: for evaluation and viewers alone; see `LockstepRunner`.

    Raises ConfigError, ModuleFault: see `build_robot`; so for every other module.
    """
    robot = build_robot(stack, seed)
    return LockstepRunner(stack, robot, limits), robot
