"""`golem faults --live`: a subset of the faults against real processes on a real domain.

`golem launch` starts a hanging twin, its gate and its stack. Then processes are killed and stopped, strangers write
what is not theirs, and the operator asks. What the gate says, and when, is heard on the domain by the wall clock. The
gate of a simulation waits up to 2 s for a robot whose time may stand still; on the robot it does not.
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from signal import SIGCONT, SIGKILL, SIGSTOP, Signals

import numpy as np
from tyro.conf import OmitArgPrefixes

from golem.errors import GolemError
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.gate import passive
from golem.interfaces import public
from golem.interfaces.payloads import GateState, Reason
from golem.middleware.dds import discovery
from golem.middleware.dds.base import ENCAPSULATION
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.ros import names
from golem.middleware.ros.codec import dds_name
from golem.middleware.ros.msgs.std_srvs import SetBool_Request, Trigger_Request
from golem.middleware.wire.convert import MODE_MACHINE, encode_low_command
from golem.runtime.bringup.robot_link import RobotLink
from golem.runtime.live.exclusive_writers import owner
from golem.runtime.live.launch import Process
from golem.runtime.live.node_setup import log_line, member
from golem.runtime.live.operator import ask
from golem.types import TICK

PATIENCE = 120.0
"""How long is waited for a robot that is to be active [s]: a busy machine takes its time."""
HEARD = 10.0
"""How long is waited for what the gate makes of a fault [s]."""
DAMPED = 2.6
"""Fastest joint of arms that sink damped [rad/s]; limp ones fall at 5."""
BYTES = 1004
"""Length of what a stranger writes as a state."""


@dataclass(frozen=True)
class LiveFaultsConfig:
    """Try some faults against real processes: they are started, on a domain that nobody else uses."""

    live: bool = True
    """Against real processes."""
    stack: str = "tether"
    """Stack whose robot hangs."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


class LiveRobot:
    """A launched robot, as a stranger sees it."""

    def __init__(self, participant: CycloneParticipant, link: RobotLink, dds: DdsConfig) -> None:
        self._participant, self.link, self._dds = participant, link, dds

    def kill(self, name: str, number: Signals) -> None:
        """Send a signal to one of its processes. Raises GolemError: there is none of that name."""
        for found in discovery.members(self._participant):
            who = owner(self._participant, found.guid)
            process = re.search(r"\(process (\d+)", who)
            if who.startswith(f"golem {name},") and process is not None:
                os.kill(int(process[1]), number)
                return
        raise GolemError(f"Nobody called '{name}' is on {self._dds}.")

    def restart(self, name: str) -> None:
        """Have one of its processes started again."""
        ask(self.link.node, f"/launch/restart_{name}", public.TRIGGER, Trigger_Request(), "launch a robot")

    def press(self, pressed: bool) -> None:
        """Press the virtual button, or release it."""
        kind = "std_srvs/srv/SetBool"
        ask(self.link.node, "/estop/press", kind, SetBool_Request(pressed), "launch a robot")

    def write(self, topic: str, payload: Callable[[], bytes], seconds: float = 1.0) -> None:
        """Write on a topic as a stranger, every tick."""
        row = public.topic(topic)
        with closing(connect(self._dds, "")) as stranger:
            writer = stranger.writer(names.topic(row.name), dds_name(row.type), row.qos)
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                writer.write(payload())
                self.link.spin(TICK)

    def activate(self) -> bool:
        """Bring the gate to let commands through; return whether it does."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            gate = self.link.gate
            if gate is not None and gate.state is GateState.ACTIVE:
                return True
            try:
                # Legs that stand by the gate stay in stop2: a reset only takes the reason away.
                ready = gate is not None and (gate.state is GateState.ARMED or gate.reason is None)
                self.link.ask("activate" if ready else "reset")
            except GolemError:
                pass  # its process is starting
            self.link.spin(0.3)
        return False


@dataclass(frozen=True)
class LiveFault:
    """One fault."""

    name: str
    inject: Callable[[LiveRobot], object]
    reasons: frozenset[Reason]
    restore: Callable[[LiveRobot], None] = lambda robot: None


def _damping() -> bytes:
    return encode_low_command(passive(0.0, None, SafetyLimits.from_profile().damping), MODE_MACHINE)


_RNG = np.random.default_rng(0)
WRITERS = frozenset({Reason.WRITERS, Reason.NOT_IN_CONTROL})
FAULTS: tuple[LiveFault, ...] = (
    LiveFault("operator asks for a stop", lambda r: r.link.ask("stop"), frozenset({Reason.REQUESTED})),
    LiveFault("e-stop pressed", lambda r: r.press(True), frozenset({Reason.ESTOP_PRESSED}), lambda r: r.press(False)),
    LiveFault("a stranger writes /lowcmd", lambda r: r.write("/lowcmd", _damping), WRITERS),
    LiveFault(
        "a stranger writes /safety/lowcmd_in",
        lambda r: r.write("/safety/lowcmd_in", _damping),
        # What comes first decides: the stranger's first command, which has no stamp, or that there is a stranger.
        WRITERS | {Reason.COMMAND_UNSTAMPED},
    ),
    LiveFault(
        "random bytes as /lowstate",
        lambda r: r.write("/lowstate", lambda: ENCAPSULATION + _RNG.bytes(BYTES)),
        frozenset({Reason.STATE_DAMAGED, Reason.WRITERS}),
    ),
    LiveFault(
        "stack stopped",
        lambda r: r.kill("up", SIGSTOP),
        frozenset({Reason.COMMAND_STALE}),
        lambda r: r.kill("up", SIGCONT),
    ),
    LiveFault(
        "stack killed", lambda r: r.kill("up", SIGKILL), frozenset({Reason.COMMAND_STALE}), lambda r: r.restart("up")
    ),
    LiveFault(
        "twin killed", lambda r: r.kill("twin", SIGKILL), frozenset({Reason.STATE_STALE}), lambda r: r.restart("twin")
    ),
)
"""What is tried, in this order; after them the gate is killed."""


def run_live_faults(config: LiveFaultsConfig) -> bool:
    """Try the faults and print a line for each; return whether each was answered rightly.

    Raises:
        ConfigError, DdsError: an option is wrong, or the domain cannot be joined.
        GolemError: the robot did not start.
    """
    launched = Process("launch", ["launch", config.stack, *config.dds.words()])
    try:
        with member("faults", config.dds) as (participant, node):
            robot = LiveRobot(participant, RobotLink(participant, node, config.dds), config.dds)
            if not robot.link.spin(PATIENCE, lambda: _active(robot)):
                raise GolemError(f"The robot did not become active within {PATIENCE:g} s.")
            wrong = sum(not _try(robot, fault) for fault in FAULTS)
            wrong += not _gate_killed(robot)
    finally:
        launched.end()
    log_line(f"{len(FAULTS) + 1 - wrong} of {len(FAULTS) + 1} faults were answered rightly.")
    return wrong == 0


def _active(robot: LiveRobot) -> bool:
    return robot.link.gate is not None and robot.link.gate.state is GateState.ACTIVE


def _try(robot: LiveRobot, fault: LiveFault) -> bool:
    if not robot.activate():
        log_line(f"{fault.name}: the robot did not become active again")
        return False
    robot.link.spin(1.0)
    began = time.monotonic()
    robot.link.stopped_at = None
    fault.inject(robot)
    robot.link.spin(HEARD, lambda: not _active(robot))
    heard = robot.link.stopped_at
    gate = robot.link.gate
    right = gate is not None and gate.reason in fault.reasons
    after = "never" if heard is None else f"after {heard - began:.2f} s"
    log_line(f"{fault.name}: {'right' if right else 'WRONG'}: {gate.why if gate is not None else ''}, {after}")
    fault.restore(robot)
    return right


def _gate_killed(robot: LiveRobot) -> bool:
    """Kill the gate; return whether the arms then sank damped."""
    if not robot.activate():
        return False
    robot.kill("safety", SIGKILL)
    heard = robot.link.listen(3.0)
    fastest = max((float(np.abs(state.dq).max()) for _, state in heard), default=np.inf)
    right = fastest < DAMPED
    log_line(f"gate killed: {'right' if right else 'WRONG'}: no joint faster than {fastest:.1f} rad/s")
    return right
