"""Twin, stack and the safety process in lock-step, the last behind the robot's own wire, so that faults can get at it.

The stack and the twin share a bus. Between them every state and every command is encoded, handed to the real
`SafetyProcess` over a domain inside this process, and what it tells the motors is decoded as the robot does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from golem.hardware.estop.estop_config import VirtualEstop
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import public, topics
from golem.interfaces.payloads import GateState, GateStatus, Reason
from golem.interfaces.ros_convert import base_estimate
from golem.middleware.bus import Bus
from golem.middleware.dds.base import Qos
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros import names
from golem.middleware.ros.codec import dds_name
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.ros.node import RosNode
from golem.middleware.wire import convert, hg
from golem.middleware.wire.struct_layout import WireError
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.executor import Executor, Phase, in_order
from golem.runtime.live.safety_process import SafetyProcess
from golem.runtime.lockstep import build_robot
from golem.runtime.node_groups import RobotNodes, StackNodes
from golem.runtime.standing_legs import StandingLegs
from golem.stack import Stack
from golem.types import TICK, LowCommand, LowState, Twist


class Expect(StrEnum):
    """What a gate has to do under a fault."""

    STOP = "stop"
    """Stop for one of the reasons, in time."""
    STOP1 = "stop1"
    """The same, and damp: nobody stands with it."""
    BEAR = "bear"
    """Go on, and the robot with it as if there were no fault."""
    SAFE = "safe"
    """Stop or go on: what the robot does is judged, and no limit may be left."""


class FaultSource(StrEnum):
    """Where a fault comes from."""

    COMMAND = "command"
    DATA = "data"
    DEVICE = "device"
    """A motor, the emergency stop, the gate's own process."""


@dataclass
class FaultMoment:
    """How far a fault has come.

    Attributes:
        t: time since it began [s].
        k: ticks since then.
        kept: what the fault remembers from one tick to the next.
        rng: its own noise.
    """

    t: float = 0.0
    k: int = 0
    kept: dict[str, Any] = field(default_factory=dict[str, Any])
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))


Edit = Callable[[FaultMoment, Any], None]
"""Changes the image of a frame."""
Frames = Sequence[bytes]


@dataclass(frozen=True)
class Injection:
    """One fault.

    Attributes:
        reasons: the right ones for a stop.
        within: robot time in which the gate has to stop [s].
        lasting: how long it is watched [s].
        stands: whether it leaves legs and state sound, so that a robot that stood has to stand in the end.
        state, command: spoil a frame on its way to the gate, into any number of frames.
        senses: spoils what the robot measures, for the gate and the stack alike.
        motors: spoils what the motors make of a command.
        gate: called with the rig before each tick of the gate.
    """

    name: str
    source: FaultSource
    expect: Expect
    reasons: tuple[Reason, ...] = ()
    within: float = 0.002
    lasting: float = 1.5
    stands: bool = False
    state: Callable[[FaultMoment, bytes], Frames] | None = None
    command: Callable[[FaultMoment, bytes], Frames] | None = None
    senses: Callable[[FaultMoment, LowState], LowState] | None = None
    motors: Callable[[FaultMoment, LowCommand], LowCommand] | None = None
    gate: Callable[[FaultMoment, Any], None] | None = None


def edited_state(payload: bytes, edit: Callable[[Any], None]) -> bytes:
    """Return the `LowState_` with its image edited, and a checksum that holds."""
    changed = bytearray(payload)
    edit(hg.LOW_STATE.read(changed))
    hg.STATE_CHECKSUM.seal(changed)
    return bytes(changed)


def edited_command(payload: bytes, edit: Callable[[Any], None]) -> bytes:
    """Return the `LowCmd_` with its image edited, and a checksum that holds."""
    changed = bytearray(payload)
    edit(hg.LOW_CMD.read(changed))
    hg.COMMAND_CHECKSUM.seal(changed)
    return bytes(changed)


def by_command(edit: Edit) -> Callable[[FaultMoment, bytes], Frames]:
    """Return a fault that edits each command."""
    return lambda m, payload: [edited_command(payload, lambda image: edit(m, image))]


def by_state(edit: Edit) -> Callable[[FaultMoment, bytes], Frames]:
    """Return a fault that edits each state."""
    return lambda m, payload: [edited_state(payload, lambda image: edit(m, image))]


TEMPERATURE, VOLTAGE = 40, 58.0
"""What the motors of the rig report while they are well [degrees, V]."""


class FaultyRobot:
    """The twin with what its sensors and motors may do wrong; a node that spoils measurements as they are published."""

    period = TICK

    def __init__(self, rig: FaultRig) -> None:
        self._rig = rig

    def step(self, t: float) -> None:
        """Spoil the newest measurement."""
        rig = self._rig
        state = rig.bus.latest(topics.LOW_STATE)
        if rig.fault is not None and rig.fault.senses is not None and state is not None:
            rig.bus.publish(topics.LOW_STATE, rig.fault.senses(rig.moment, state), t)


class FaultRig:
    """A robot in operation, and the way into its safety layer.

    Attributes:
        clock: what the gate's clock shows beyond the robot's time [s].
        held: whether the gate does not run.
        fault: what is being tried; None before.
        moment: how far it has come.
        told: what reached the motors at this tick; None where nothing did.
        machine: the machine type that the robot reports.
        twist: what the robot is told to walk at; None lets it stand or hang.
    """

    period = TICK

    def __init__(self, stack: Stack, seed: int) -> None:
        """Build the robot of `stack` for the twin's `seed`. Raises ConfigError, ModuleFault: see `LockstepRunner`."""
        robot = build_robot(stack, seed)
        assert isinstance(robot, MujocoRobot)
        self.robot = robot
        self.bus, self.estop = Bus(), VirtualEstop()
        self.clock, self.held, self.machine = 0.0, False, 0
        self.fault: Injection | None = None
        self.moment = FaultMoment()
        self.told: LowCommand | None = None
        self.twist: Twist | None = None
        self.t = 0.0
        self.domain = LocalDomain()
        safety, self._member = self.domain.participant(), self.domain.participant()
        limits = SafetyLimits.from_profile(stack.limits)
        if not robot.living:
            limits = limits.still()
        node, standing = RosNode(safety, "safety"), StandingLegs if stack.on_ground else None
        self.gate = SafetyProcess(
            safety, node, limits, self.estop, clock=lambda: 1000.0 + self.t + self.clock, standing=standing
        )
        self.states, self.commands = (self.writer(name) for name in ("/lowstate", "/safety/lowcmd_in"))
        row = public.topic("/lowcmd")
        self._motors = self._member.reader(names.topic(row.name), dds_name(row.type), Qos(reliable=False, depth=64))
        node, base = RosNode(self._member, "others"), public.topic("/base_estimate")
        self._base = node.publisher(base.name, base.type, base.qos)
        self._activate = node.client("/safety/activate", public.TRIGGER)
        self._reset = node.client("/safety/reset", public.TRIGGER)
        nodes = RobotNodes(self.bus, stack, robot, None, None)
        gantry: Any = robot
        modules = StackNodes(self.bus, stack, robot.calibration, None, gantry, 0.0)
        placed = nodes.nodes + [(Phase.MEASURE, FaultyRobot(self)), (Phase.PROTECT, self)] + modules.nodes
        self.executor = Executor(self.bus, in_order(placed))

    def writer(self, topic: str) -> Any:
        """Return a new writer of one of the vendor's topics."""
        row = public.topic(topic)
        return self._member.writer(names.topic(row.name), dds_name(row.type), row.qos)

    def activate(self) -> None:
        """Ask the gate to let commands pass."""
        self._activate.call(Trigger_Request())

    def reset(self) -> None:
        """Ask the gate to forget its stop."""
        self._reset.call(Trigger_Request())

    def begin(self, fault: Injection) -> None:
        """Let `fault` begin at the next tick."""
        self.fault, self.moment = fault, FaultMoment()

    @property
    def status(self) -> GateStatus:
        """The newest verdict of the gate."""
        return self.gate.status

    def step(self, t: float) -> None:
        """Carry state and command to the gate, run it, and carry what it says to the motors; a node's step."""
        self.t = t
        fault, moment = self.fault, self.moment
        if self.twist is not None:
            self.bus.publish(topics.TWIST, self.twist, t)
        if fault is not None and fault.gate is not None:
            fault.gate(moment, self)
        self._send(t)
        if not self.held:
            self.gate.step()
        self._receive(t)
        status = self.gate.status
        if not self.held or status.state is not GateState.ACTIVE:
            self.bus.publish(topics.SAFETY, GateStatus(t, status.state, status.reason, status.detail), t)
        if fault is not None:
            moment.k += 1
            moment.t = moment.k * TICK

    def _send(self, t: float) -> None:
        fault, moment = self.fault, self.moment
        state, command = self.bus.latest(topics.LOW_STATE), self.bus.latest(topics.LOW_CMD_REQUEST)
        if state is not None:
            payload = edited_state(convert.encode_low_state(state, self.machine), _well)
            frames = [payload] if fault is None or fault.state is None else fault.state(moment, payload)
            for frame in frames:
                self.states.write(frame)
        if command is not None and state is not None:
            payload = convert.encode_low_command(command, 0, answers=state.t)
            frames = [payload] if fault is None or fault.command is None else fault.command(moment, payload)
            for frame in frames:
                self.commands.write(frame)
        base = self.bus.latest(topics.BASE)
        if base is not None:
            self._base.publish(base_estimate(base))

    def _receive(self, t: float) -> None:
        self.told = None
        for sample in self._motors.take(64):
            if not sample.alive:
                continue
            try:
                self.told = convert.decode_low_command(sample.payload, t, self.machine)
            except WireError:
                continue  # as the robot does
        if self.told is not None:
            command, fault = self.told, self.fault
            if fault is not None and fault.motors is not None:
                command = fault.motors(self.moment, command)
            self.bus.publish(topics.LOW_CMD, command, t)

    def close(self) -> None:
        """Release what the twin holds."""
        self.robot.close()


def _well(image: Any) -> None:
    image["motor"]["temperature"] = TEMPERATURE
    image["motor"]["vol"] = VOLTAGE
