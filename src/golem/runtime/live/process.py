"""`golem twin` and `golem up`: the processes of a live robot beside `golem safety`."""

from __future__ import annotations

import ctypes
import math
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field
from functools import partial

from tyro.conf import OmitArgPrefixes, Positional

from golem.errors import ConfigError
from golem.interfaces.payloads import GateState, GateStatus
from golem.middleware.dds.domain import ROBOT_DOMAIN, DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.interrupt import interrupted
from golem.robots.base import Restorable
from golem.runtime.live.exclusive_writers import launcher, owner, refuse_second
from golem.runtime.live.node_setup import AsyncLogger, company, member, settle
from golem.runtime.live.render_worker import RenderWorker
from golem.runtime.live.safety_status import report
from golem.runtime.live.stack_process import StackProcess
from golem.runtime.live.twin import Twin
from golem.runtime.lockstep import build_robot
from golem.runtime.node_groups import POOLED
from golem.stack import load_stack

LARGE = 1 << 16
"""Size from which a block of memory is mapped by itself [bytes]: an image's arrays, and clouds."""
_M_MMAP_THRESHOLD = -3
"""Parameter of glibc's mallopt (malloc.h)."""


def map_large_blocks() -> None:
    """Have blocks of `LARGE` or more mapped each by itself, unless a hole fits, and given back when freed; glibc only.

    Without this glibc raises the bound to the largest block that was freed so far, up to 32 MB. Images then lie
    between small objects, whose holes stay: the stack process grew by 4 to 10 MB a pick.
    """
    with suppress(OSError, AttributeError):
        ctypes.CDLL("libc.so.6").mallopt(_M_MMAP_THRESHOLD, LARGE)


ALONE = 5.0
"""Time without a robot after which the stack says what it waits for [s]."""


@dataclass(frozen=True)
class TwinConfig:
    """Put the simulated robot of a stack file on a domain, with its on-board computer and the wall clock."""

    stack: Positional[str] = "tether"
    """Path of a stack file, or the name of a shipped one."""
    world: str | None = None
    """World of the twin: pack, plant, ioniq5, ioniq5_plant, kitchen, counter, robocasa, open, slope, step, rubble,
    furnished or corridor; default: the stack file's."""
    profile: str | None = None
    """Realism profile: ideal, bench or field; default: the stack file's."""
    seed: int = 0
    """Seed of the episode."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


@dataclass(frozen=True)
class UpConfig:
    """Run the modules of a stack file for the robot on a domain."""

    stack: Positional[str] = "tether"
    """Path of a stack file, or the name of a shipped one."""
    profile: str | None = None
    """Realism profile that the twin was given, if not the stack file's."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


def run_twin(config: TwinConfig) -> None:
    """Simulate until Ctrl-C.

    Raises:
        ConfigError: an option or the stack file is wrong, or a robot is on the domain already.
        DdsError: the domain cannot be joined.
    """
    if config.dds.robot or config.dds.domain == ROBOT_DOMAIN:
        raise ConfigError(f"A twin never joins domain {ROBOT_DOMAIN}, which is the real robot's; choose another.")
    stack = load_stack(config.stack, profile=config.profile)
    if config.world is not None:
        stack = stack.with_options("robot", world=config.world)
    with interrupted() as stop, closing(AsyncLogger()) as tell, member("twin", config.dds, tell) as (participant, node):
        refuse_second(participant, config.dds, "/lowstate", "/clock")
        with closing(build_robot(stack, config.seed)) as robot, ExitStack() as closing_time:
            render_worker = None
            if isinstance(robot, Restorable):
                render_worker = closing_time.enter_context(closing(RenderWorker(stack, config.seed, robot, config.dds)))
            twin = Twin(stack, robot, participant, node, render_worker, tell=tell)
            if render_worker is not None:
                render_worker.wait(stop.is_set)
            tell(f"The twin of '{config.stack}' is on {config.dds}. Ctrl-C ends it.")
            settle()
            twin.run(stop.is_set)


def run_up(config: UpConfig) -> None:
    """Run the stack until Ctrl-C.

    Raises:
        ConfigError: an option or the stack file is wrong, or a stack is on the domain already.
        DdsError: the domain cannot be joined.
        ModuleFault: a module broke its contract; the safety gate, which hears no more commands, damps the robot.
    """
    map_large_blocks()
    stack = load_stack(config.stack, profile=config.profile, whole=config.dds.robot)
    with (
        interrupted() as stop,
        closing(AsyncLogger()) as tell,
        ExitStack() as threads,
        member("up", config.dds, tell) as (participant, node),
    ):
        refuse_second(participant, config.dds, "/safety/lowcmd_in")
        pools = {slot: threads.enter_context(ThreadPoolExecutor(1, slot)) for slot in POOLED}
        live = StackProcess(
            stack, participant, node, real=config.dds.robot, pools=pools, tell=tell, who=partial(owner, participant)
        )
        tell(f"The stack '{config.stack}' is on {config.dds}. Ctrl-C ends it.")
        waiting_since = time.monotonic()
        said, restarts = GateStatus(0.0, GateState.INIT), 0
        settle()
        while not stop.is_set():
            live.states.wait(0.02)
            live.step()
            if live.side is None:
                if time.monotonic() - waiting_since > ALONE:
                    # Whoever launches a robot says what becomes of it.
                    launched = launcher(participant)
                    waiting_since = time.monotonic() if launched else math.inf
                    if not launched:
                        tell(_no_robot(config, participant))
                continue
            if live.restarts != restarts:
                restarts = live.restarts
                tell("The robot was restarted, and so was the stack.")
            said = report(said, live.side.safety or said, tell)


def _no_robot(config: UpConfig, participant: CycloneParticipant) -> str:
    start = "" if config.dds.robot else f" Start one with: {config.dds.command('twin ' + config.stack)}"
    return f"No robot on {config.dds} yet; {company(participant, config.dds)}.{start}"
