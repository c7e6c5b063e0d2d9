"""`golem safety`. It imports no simulator and no module of a stack: a gate that is started again is there at once."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from tyro.conf import OmitArgPrefixes

from golem.errors import ConfigError, MissingExtra
from golem.hardware.estop.estop_config import EstopConfig
from golem.hardware.safety.base import SafetyLimits
from golem.middleware.dds import discovery
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.interrupt import interrupted
from golem.middleware.ros import names
from golem.runtime.live.exclusive_writers import owner, refuse_second
from golem.runtime.live.node_setup import AsyncLogger, member, settle
from golem.runtime.live.safety_process import SafetyProcess
from golem.runtime.live.safety_status import report
from golem.types import TICK

if TYPE_CHECKING:
    from golem.runtime.live.black_box import BlackBox
    from golem.runtime.standing_legs import StandingLegs


MOVING = ("/lowcmd", "/safety/lowcmd_in", "/cmd_vel", "/cmd_height", "/left/gripper/command", "/right/gripper/command")
"""Topics whose writers move the robot, or may."""
CALLS = ("/safety/", "/estop/", "/skill/", "/launch/", "/left/gripper/", "/right/gripper/", "/api/")
"""How names begin of services and actions whose callers do."""
PERIOD = 2.0
"""Time between two looks [s]."""


def commands(wire: str) -> str:
    """Return the ROS name of a topic on the wire if who writes it asks something of the robot; else an empty string."""
    kind, name = names.from_wire(wire)
    if kind == "topic":
        asks = name in MOVING or (name.startswith("/api/") and name.endswith("/request"))
        return name if asks else ""
    return name if kind == "request" and name.startswith(CALLS) else ""


def unknown_senders(participant: CycloneParticipant) -> list[str]:
    """Return a line for each process that is none of ours and writes what moves the robot: what, and who."""
    found: dict[str, set[str]] = {}
    for writer in discovery.writers(participant):
        name = commands(writer.topic)
        if not name or writer.participant == participant.guid:
            continue
        who = owner(participant, writer.guid)
        if who == writer.guid.hex():
            who = f"participant {writer.guid[:12].hex()}"  # over Fast DDS a process does not tell its name
        if not who.startswith("golem "):
            found.setdefault(who, set()).add(name)
    return [f"{who} ({', '.join(sorted(topics))})" for who, topics in sorted(found.items())]


class SenderWatch:
    """Looks for unknown senders on a thread of its own: a look takes longer than the gate has."""

    def __init__(self, participant: CycloneParticipant) -> None:
        self.found: tuple[str, ...] = ()
        self._participant = participant
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="senders", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop looking."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(PERIOD):
            try:
                self.found = tuple(unknown_senders(self._participant))
            except Exception as error:  # a look that failed must not read like nobody who sends
                self.found = (f"not known, the look failed: {error or type(error).__name__}",)


ROBOT_LIMITS = "urdf"
"""Limit profile of the real robot: the smaller torques."""


@dataclass(frozen=True)
class SafetyConfig:
    """Guard the robot on a domain: emergency stop and safety gate, and nothing else in this process.

    To ask something of the one that runs: golem safety activate, stop, reset, hand-over, press, release or status. To
    have a robot's own controller let go of the motors: golem safety take.
    """

    limits: str = "urdf"
    """Limit profile to enforce: urdf or paper. The stack file's is not read here: the gate trusts no stack."""
    strict: bool = False
    """Stop a simulated robot as early as the real one for what is late: a busy machine then stops it."""
    still: bool = False
    """The sensors of the simulated robot have no noise (profile ideal): do not stop it where they stand still."""
    stand: bool = False
    """The robot stands on its feet: where a stop leaves state and legs sound, shipped legs go on standing."""
    black_box: Path | None = Path("runs/stops")
    """Folder for bags of what was heard and said from 5 s before each stop to 2 s after it; 'None' keeps nothing."""
    estop: EstopConfig = field(default_factory=EstopConfig)
    """The emergency stop. A real robot has none until its board is named."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


def run_safety(config: SafetyConfig) -> None:
    """Guard until Ctrl-C; a robot in motion is damped first.

    Raises:
        ConfigError: an option is wrong, or a gate is on the domain already.
        DdsError: the domain cannot be joined.
        MissingExtra, PortError: the board of the emergency stop cannot be opened.
    """
    limits = SafetyLimits.from_profile(config.limits)
    if config.dds.robot and config.limits != ROBOT_LIMITS:
        raise ConfigError(f"The real robot is guarded with --limits {ROBOT_LIMITS}, not '{config.limits}'.")
    if config.still:
        if config.dds.robot:
            raise ConfigError("A real robot's sensors never stand still: leave out --still.")
        limits = limits.still()
    standing: Callable[[], StandingLegs] | None = None
    if config.stand:
        # Imported here: without it this process has no module of a stack in it.
        from golem.runtime.standing_legs import StandingLegs

        standing = StandingLegs
    patient = not (config.strict or config.dds.robot)
    virtual = config.estop.use == "virtual"
    estop = None if virtual and config.dds.robot else config.estop.create()
    with (
        # Ctrl-Z or Ctrl-\ in the wrong terminal would freeze or kill the gate, and leave the motors a stiff command.
        interrupted(also=(signal.SIGTSTP, signal.SIGQUIT)) as stop,
        closing(AsyncLogger()) as tell,
        member("safety", config.dds, tell) as (participant, node),
        ExitStack() as watching,
    ):
        refuse_second(participant, config.dds, "/lowcmd")
        senders = watching.enter_context(closing(SenderWatch(participant)))
        who = partial(owner, participant)
        gate = SafetyProcess(
            participant,
            node,
            limits,
            estop,
            who=who,
            patient=patient,
            real=config.dds.robot,
            standing=standing,
            black_box=_black_box(config, tell),
            senders=lambda: senders.found,
        )
        tell(f"The safety gate is on {config.dds}. Ctrl-C stops the robot and ends it.")
        if config.still:
            tell("Sensors that stand still do not stop the robot: --still.")
        if estop is None:
            tell(
                "No emergency stop is here, so the gate stays shut; "
                "name its board: --estop.use serial --estop.port /dev/ttyACM0."
            )
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


def _black_box(config: SafetyConfig, tell: Callable[[str], None]) -> BlackBox | None:
    if config.black_box is None:
        return None
    try:
        from golem.runtime.live.black_box import BlackBox
    except MissingExtra as error:
        tell(f"There is no black box: {error}")
        return None
    return BlackBox(config.black_box, tell)
