"""`golem twin`, `golem safety` and `golem up`: the processes of a live robot."""

from __future__ import annotations

import gc
import signal
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from functools import partial

from tyro.conf import OmitArgPrefixes, Positional

from golem.errors import ConfigError
from golem.hardware.estop.virtual import VirtualEstop
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces.payloads import GateState, GateStatus
from golem.middleware.dds.domain import ROBOT_DOMAIN, DdsConfig
from golem.middleware.interrupt import interrupted
from golem.robots.base import Restorable
from golem.runtime.live.exclusive_writers import owner, refuse_second
from golem.runtime.live.node_setup import AsyncLogger, company, member
from golem.runtime.live.render_worker import RenderWorker
from golem.runtime.live.safety_process import SafetyProcess
from golem.runtime.live.safety_status import describe_status
from golem.runtime.live.stack_process import StackProcess
from golem.runtime.live.twin import Twin
from golem.runtime.lockstep import build_robot
from golem.stack import Stack, load_stack
from golem.types import TICK

ROBOT_LIMITS = "urdf"
"""Limit profile of the real robot: the smaller torques."""
ALONE = 5.0
"""Time without a robot after which the stack says what it waits for [s]."""


@dataclass(frozen=True)
class TwinConfig:
    """Put the simulated robot of a stack file on a domain, with its on-board computer and the wall clock."""

    stack: Positional[str] = "tether"
    """Path of a stack file, or the name of a shipped one."""
    world: str | None = None
    """World of the twin: pack, open, slope or rubble; default: the stack file's."""
    profile: str | None = None
    """Realism profile: ideal, bench or field; default: the stack file's."""
    seed: int = 0
    """Seed of the episode."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


@dataclass(frozen=True)
class SafetyConfig:
    """Guard the robot on a domain: emergency stop and safety gate, and nothing else in this process.

    To ask something of the one that runs: golem safety activate, stop, reset, press, release or status. To have a
    robot's own controller let go of the motors: golem safety take.
    """

    limits: str = "urdf"
    """Limit profile to enforce: urdf or paper. The stack file's is not read here: the gate trusts no stack."""
    strict: bool = False
    """Stop a simulated robot as early as the real one for what is late: a busy machine then stops it."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


@dataclass(frozen=True)
class UpConfig:
    """Run everything of a stack file that decides what the robot on a domain does."""

    stack: Positional[str] = "tether"
    """Path of a stack file, or the name of a shipped one."""
    profile: str | None = None
    """Realism profile that the twin was given, if not the stack file's."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


def twin_stack(config: TwinConfig) -> Stack:
    """Return the stack whose robot the twin is.

    Raises:
        ConfigError: the stack file is wrong.
    """
    stack = load_stack(config.stack, profile=config.profile)
    if config.world is not None:
        options = {**stack.robot.options, "world": config.world}
        stack = replace(stack, robot=replace(stack.robot, options=options))
    return stack


def settle() -> None:
    """Take what lives by now from the garbage collector: going through it, rarely as that is, takes 50 ms and more."""
    gc.collect()
    gc.freeze()


def run_twin(config: TwinConfig) -> None:
    """Simulate until Ctrl-C.

    Raises:
        ConfigError: an option or the stack file is wrong, or a robot is on the domain already.
        DdsError: the domain cannot be joined.
    """
    if config.dds.robot or config.dds.domain == ROBOT_DOMAIN:
        raise ConfigError(
            f"A twin never joins domain {ROBOT_DOMAIN}, which is the real robot's; choose another."
        )
    stack = twin_stack(config)
    with (
        interrupted() as stop,
        closing(AsyncLogger()) as tell,
        member("twin", config.dds) as (participant, node),
    ):
        refuse_second(participant, config.dds, "/lowstate", "/clock")
        with closing(build_robot(stack, config.seed)) as robot, ExitStack() as closing_time:
            render_worker = None
            if isinstance(robot, Restorable):
                render_worker = closing_time.enter_context(
                    closing(RenderWorker(stack, config.seed, robot, config.dds))
                )
            twin = Twin(stack, robot, participant, node, render_worker, tell=tell)
            if render_worker is not None:
                render_worker.wait(stop.is_set)
            tell(f"The twin of '{config.stack}' is on {config.dds}. Ctrl-C ends it.")
            settle()
            twin.run(stop.is_set)


def run_safety(config: SafetyConfig) -> None:
    """Guard until Ctrl-C; a robot in motion is damped first.

    Raises:
        ConfigError: an option is wrong, or a gate is on the domain already.
        DdsError: the domain cannot be joined.
    """
    limits = SafetyLimits.from_profile(config.limits)
    if config.dds.robot and config.limits != ROBOT_LIMITS:
        raise ConfigError(f"The real robot is guarded with --limits {ROBOT_LIMITS}, not '{config.limits}'.")
    patient = not (config.strict or config.dds.robot)
    estop = None if config.dds.robot else VirtualEstop()
    with (
        # Ctrl-Z or Ctrl-\ in the wrong terminal would freeze or kill the gate, and leave the motors a stiff command.
        interrupted(also=(signal.SIGTSTP, signal.SIGQUIT)) as stop,
        closing(AsyncLogger()) as tell,
        member("safety", config.dds) as (participant, node),
    ):
        refuse_second(participant, config.dds, "/lowcmd")
        who = partial(owner, participant)
        gate = SafetyProcess(
            participant, node, limits, estop, who=who, patient=patient, real=config.dds.robot
        )
        tell(f"The safety gate is on {config.dds}. Ctrl-C stops the robot and ends it.")
        if estop is None:
            tell("No driver of an emergency stop is here: the gate stays shut.")
        said = gate.status
        settle()
        try:
            while not stop.is_set():
                gate.commands.wait(TICK)
                gate.step()
                said = report(said, gate.status, tell)
            while not gate.stop():
                gate.commands.wait(TICK)
        except BaseException:
            # Without the gate, which has just failed: the last command must not be a stiff one.
            end = time.monotonic() + limits.damping_time
            while time.monotonic() < end:
                gate.damp()
                time.sleep(TICK)
            raise
        report(said, gate.status, tell)


def run_up(config: UpConfig) -> None:
    """Run the stack until Ctrl-C.

    Raises:
        ConfigError: an option or the stack file is wrong, or a stack is on the domain already.
        DdsError: the domain cannot be joined.
        ModuleFault: a module broke its contract; the safety gate, which hears no more commands, damps the robot.
    """
    stack = load_stack(config.stack, profile=config.profile)
    with (
        interrupted() as stop,
        closing(AsyncLogger()) as tell,
        ThreadPoolExecutor(1, "localizer") as pool,
        member("up", config.dds) as (participant, node),
    ):
        refuse_second(participant, config.dds, "/safety/lowcmd_in")
        live = StackProcess(stack, participant, node, real=config.dds.robot, pool=pool, tell=tell)
        tell(f"The stack '{config.stack}' is on {config.dds}. Ctrl-C ends it.")
        waiting_since: float | None = time.monotonic()
        said, restarts = GateStatus(0.0, GateState.INIT), 0
        settle()
        while not stop.is_set():
            live.states.wait(0.02)
            live.step()
            if live.side is None:
                if waiting_since is not None and time.monotonic() - waiting_since > ALONE:
                    waiting_since = None
                    start = (
                        ""
                        if config.dds.robot
                        else f" Start one with: {config.dds.command('twin ' + config.stack)}"
                    )
                    tell(f"No robot on {config.dds} yet; {company(participant, config.dds)}.{start}")
                continue
            if live.restarts != restarts:
                restarts = live.restarts
                tell("The robot was started anew, and so was the stack.")
            said = report(said, live.side.safety or said, tell)


def report(before: GateStatus, now: GateStatus, tell: Callable[[str], None]) -> GateStatus:
    """Tell what the gate is now if it changed; return it."""
    if (now.state, now.reason) != (before.state, before.reason):
        tell(f"Safety gate: {describe_status(now)}")
    return now
