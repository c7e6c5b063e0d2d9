"""The safety process: the emergency stop and the gate, on a monotonic clock of their own.

Whatever arrives is stamped by this clock when it arrives, so that nobody else's clock can make something old look new.
The robot's time serves only to tell a new state from a repeated one, and which state a command answers.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from golem.hardware.estop.virtual import VirtualEstop
from golem.hardware.safety.base import OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import passive
from golem.interfaces import topics
from golem.interfaces.payloads import Fault, GateState, GateStatus, Reason
from golem.interfaces.ros_convert import diagnostic, diagnostics, header, to_base_estimate
from golem.middleware.bus import Bus, News, Topic
from golem.middleware.dds.base import Participant, Qos, Sample
from golem.middleware.ros.base import RosNode
from golem.middleware.ros.msgs import golem_interfaces
from golem.middleware.ros.msgs.diagnostic_msgs import DiagnosticStatus
from golem.middleware.ros.msgs.std_srvs import SetBool_Request, SetBool_Response, Trigger_Response
from golem.middleware.ros.waitset import WaitSet
from golem.middleware.wire import convert
from golem.middleware.wire.struct_layout import WireError
from golem.robots.model.table import JOINT_NAMES
from golem.runtime.executor import in_order
from golem.runtime.live import sim_sync
from golem.runtime.live.clock import Every, Rate, RobotClock, time_since_boot
from golem.runtime.live.motion_switcher_client import MotionSwitcherClient
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.safety_status import describe_status, status_message
from golem.runtime.node_groups import SafetyNodes
from golem.types import LowCommand

REMEMBERED = 256
"""States whose time of arrival is remembered: half a second."""
PERSISTENT = 25
"""States in a row with a motor's error that are a fault [own: as many as stop the legs for a speed]."""
LOOK = 0.05
"""Time between two looks for other writers of the motors' command [s]."""
WARY = 1.0
"""Time after a pause of the gate in which it is asked for nothing but a stop [s]."""
REPORT = 0.05
"""Time between two reports while nothing changes [s]."""
DIAGNOSE = 1.0
"""Time between two diagnostics [s]."""


class Arrivals:
    """Brings states and commands to the bus of the gate, stamped with the time they arrived.

    Attributes:
        commands: what the process waits on.
        mode_machine: machine type that the robot reports; None before its first state.
        answered: robot time of the state that the newest command answers [s]; 0 where its sender does not say.
        rate: of the robot's time.
        sole: what reads each of the topics that one process alone may write.
    """

    def __init__(self, bus: Bus, endpoints: RoleEndpoints, clock: Callable[[], float]) -> None:
        """Stamp by `clock` [s]."""
        self._bus, self._clock = bus, clock
        self._arrived: OrderedDict[float, float] = OrderedDict()
        self.commands, self._states = WaitSet(), WaitSet()
        self.mode_machine: int | None = None
        self.answered = 0.0
        self.rate = Rate()
        self._faulty = 0
        # Of each there is one: commands of two stacks would take turns, and states of two robots.
        self.sole = {
            "/lowstate": endpoints.receive("/lowstate", self._states, self._state),
            "/safety/lowcmd_in": endpoints.receive("/safety/lowcmd_in", self.commands, self._command),
        }
        self._robot = RobotClock(clock, self.sole["/lowstate"].writers)

    def poll(self) -> None:
        """Take what has come; states first, since commands answer them."""
        self._states.poll()
        self.commands.poll()

    def _state(self, sample: Sample) -> None:
        now = self._clock()
        try:
            state = convert.decode_low_state(sample.payload)
        except WireError as error:
            self._refuse(Reason.STATE_DAMAGED, error, now)
            return
        if not self._robot.advances(state.t, sample.writer):
            return
        self.mode_machine = convert.mode_machine(sample.payload)
        if self._robot.anew:
            self._arrived.clear()
        self._arrived[state.t] = now
        self.rate.add(state.t, now)
        if len(self._arrived) > REMEMBERED:
            self._arrived.popitem(last=False)
        self._bus.publish(topics.LOW_STATE, replace(state, t=now), now)
        errors = convert.motor_errors(sample.payload)
        self._faulty = self._faulty + 1 if errors else 0
        if self._faulty >= PERSISTENT:
            said = ", ".join(f"{JOINT_NAMES[i]} reports error {code:#x}" for i, code in errors.items())
            self._bus.publish(topics.TRANSPORT_FAULT, Fault(Reason.MOTOR, said), now)

    def _command(self, sample: Sample) -> None:
        now = self._clock()
        try:
            command = convert.decode_low_command(sample.payload, now, self.mode_machine or 0)
            answered = convert.answered(sample.payload)
        except WireError as error:
            self._refuse(Reason.COMMAND_DAMAGED, error, now)
            return
        if answered:
            # As old as the state it answers; one that answers a state nobody remembers is too old for anything.
            command = replace(command, t=self._arrived.get(answered, -math.inf))
        self.answered = answered
        self._bus.publish(topics.LOW_CMD_REQUEST, command, now)

    def _refuse(self, reason: Reason, error: WireError, now: float) -> None:
        self._bus.publish(topics.TRANSPORT_FAULT, Fault(reason, str(error)), now)


class SafetyProcess:
    """The safety process without its loop.

    Attributes:
        commands: what to wait on between two steps.
        bus: its streams.
        status: its newest verdict.
    """

    def __init__(
        self,
        participant: Participant,
        node: RosNode,
        limits: SafetyLimits,
        estop: VirtualEstop | None,
        clock: Callable[[], float] = time_since_boot,
        who: Callable[[bytes], str] = bytes.hex,
        patient: bool = False,
        real: bool = False,
    ) -> None:
        """Guard the robot on the domain.

        Args:
            participant: member of the domain.
            node: its ROS node.
            limits: what to enforce.
            estop: the virtual emergency stop of a simulation. None where a real one belongs: until there is one,
                the gate stays shut.
            clock: monotonic [s].
            who: names the owner of an endpoint by its guid.
            patient: whether the robot's time may stand still for a stack that is behind; see `live.pace`.
            real: whether the robot's own controllers must have let go of the motors first; a twin's move none. Its
                motors must hear us then, and its time must run as ours does; that of a twin stands still at times.
        """
        if patient:
            limits = sim_sync.relaxed_limits(limits)
        self._patient, self._damping, self._stall = patient, limits.damping, limits.stall
        self.bus = Bus()
        self._node, self._clock, self._who = node, clock, who
        self._endpoints = endpoints = RoleEndpoints("safety", participant, node)
        self._arrivals = Arrivals(self.bus, endpoints, clock)
        self.commands = self._arrivals.commands
        self._out = endpoints.writer("/lowcmd")
        # Best effort, as the robot's own reader may be: a reliable one does not see writers that are.
        self._all_commands = endpoints.reader("/lowcmd", Qos(reliable=False, depth=1))
        self._switcher, self._real = MotionSwitcherClient.on(endpoints, clock), real
        self._estop = estop
        self._side = SafetyNodes(self.bus, limits, estop)
        self._nodes = in_order(self._side.nodes)
        self._estops = News(self.bus, topics.ESTOP)
        self._base_stamp = -math.inf
        self._crowded, self._unheard = "", ""
        self._listeners: set[bytes] | None = None
        self._looks, self._reports, self._diagnoses = Every(LOOK), Every(REPORT), Every(DIAGNOSE)
        self._steps = 0
        self._ending, self._halts = False, False
        self._stepped, self._paused_until = clock(), -math.inf
        self.status = GateStatus(clock(), GateState.INIT)
        endpoints.subscribe("/base_estimate", self._base)
        endpoints.serve(
            {
                "/safety/activate": lambda _: self._ask(OperatorRequest.ACTIVATE, GateState.ACTIVE),
                "/safety/stop": lambda _: self._ask(OperatorRequest.STOP, GateState.STOP1, GateState.STOP0),
                "/safety/reset": lambda _: self._ask(OperatorRequest.RESET, GateState.ARMED),
                "/estop/press": self._press,
            }
        )

    def step(self) -> None:
        """Take what has come, judge it, and tell the motors."""
        now = self._clock()
        if now - self._stepped > self._stall:
            self._paused_until, self._arrivals.rate = now + WARY, Rate()
        self._stepped = now
        self._arrivals.poll()
        self._node.poll()
        if self._looks.due(now):
            self._crowded = self._crowd()
            if self._real:
                self._listen()
        self._switcher.poll()
        self._judge()
        if self._diagnoses.due(now):
            self._diagnose(now)

    def stop(self) -> bool:
        """Ask for a stop, and return whether the gate has done damping, if it had anything to damp."""
        self._ending = True
        self._side.request(OperatorRequest.STOP)
        self.step()
        return self.status.state not in (GateState.ACTIVE, GateState.STOP1)

    def damp(self) -> None:
        """Tell the motors to damp, whatever may have failed."""
        self._tell(passive(self._clock(), None, self._damping))

    def _judge(self) -> None:
        """Run the gate once, and publish what follows."""
        now, before = self._clock(), self.status
        moving = before.state is GateState.ACTIVE
        doubts = [(Reason.WRITERS, self._crowded)]
        if self._real:
            # A robot that moves is not dropped for its clock: the unit was right, and what arrives may be late.
            clock = "" if moving or self._arrivals.mode_machine is None else self._arrivals.rate.doubt()
            held = self._switcher.doubt(moving)
            doubts += [(Reason.STATE_CLOCK, clock), (Reason.UNHEARD, self._unheard), (Reason.HELD, held)]
        for reason, detail in doubts:
            if detail:
                self.bus.publish(topics.TRANSPORT_FAULT, Fault(reason, detail), now)
        for node in self._nodes:
            node.step(now)
        self._steps += 1
        status = self.bus.latest(topics.SAFETY)
        command = self.bus.latest(topics.LOW_CMD)
        assert status is not None and command is not None
        self.status = status
        self._halts = moving and status.state is not GateState.ACTIVE
        waited_for = self._patient and status.state is GateState.ACTIVE
        self._tell(command, self._arrivals.answered if waited_for else 0.0)
        frame = self._estops.read()
        if frame is not None and self._endpoints.heard("/estop"):
            message = golem_interfaces.EstopFrame(header(now), frame.sequence, frame.pressed)
            self._endpoints.publish("/estop", message)
        if (status.state, status.reason) != (before.state, before.reason) or self._reports.due(now):
            self._endpoints.publish("/safety/status", status_message(status))

    def _tell(self, command: LowCommand, answers: float = 0.0) -> None:
        """Write `command` to the motors, unless the robot's own controllers have them or a shut gate never had them.

        Whoever gets them from a robot in motion gets them damped once: until they speak our last command stands. While
        the robot moves and is damped only an answer says that they have: drives that hear nothing may go on with the
        last command. Once it is limp, as after a reboot, silence says so, too.
        """
        limp, switcher = self.status.state is GateState.STOP0, self._switcher
        theirs = self._real and bool(switcher.owner or (limp and not switcher.free)) and not self._halts
        machine = self._arrivals.mode_machine
        if machine is not None and self.status.state is not GateState.INIT and not theirs:
            self._out.write(convert.encode_low_command(command, machine, answers))

    def _crowd(self) -> str:
        """Return who else writes what one process alone may write; empty if nobody does."""
        others = [g for g in self._all_commands.writers().values() if g != self._out.guid]
        if others:
            return f"/lowcmd is also written by {self._names(others)}"
        for topic, inbox in self._arrivals.sole.items():
            writers = list(inbox.writers().values())
            if len(writers) > 1:
                return f"{topic} is written by {len(writers)}: {self._names(writers)}"
        return ""

    def _listen(self) -> None:
        """Find out whether the motors hear: somebody who is none of ours (this gate, recorders)."""
        listeners = set(self._out.readers().values())
        if listeners == self._listeners:  # to ask who they are takes a look at the whole domain
            return
        self._listeners, ours = listeners, self._out.guid[:12]
        heard = any(g[:12] != ours and not self._who(g).startswith("golem ") for g in listeners)
        self._unheard = "" if heard else "nobody receives /lowcmd"

    def _names(self, writers: Iterable[bytes]) -> str:
        return ", ".join(map(self._who, writers))

    def _ask(self, request: OperatorRequest, *wanted: GateState) -> Trigger_Response:
        """Pass on what an operator asks for; the answer says what came of it.

        Not while this process ends, and for `WARY` after a pause nothing but a stop: who asked before may be beside the
        robot by now, and what was asked comes out of the network's queues little by little.
        """
        now = self._clock()
        if self._ending:
            return Trigger_Response(False, "The safety process ends.")
        paused = now < self._paused_until or now - self._stepped > self._stall
        if paused and request is not OperatorRequest.STOP:
            return Trigger_Response(False, f"The gate was held up; ask again in {WARY:g} s.")
        self._side.request(request)
        self._judge()
        self._side.request(OperatorRequest.NONE)
        return Trigger_Response(self.status.state in wanted, describe_status(self.status))

    def _press(self, request: SetBool_Request) -> SetBool_Response:
        if self._estop is None:
            return SetBool_Response(False, "This emergency stop is not virtual: press the button.")
        (self._estop.press if request.data else self._estop.release)()
        return SetBool_Response(True, "pressed" if request.data else "released")

    def _base(self, message: golem_interfaces.BaseEstimate) -> None:
        estimate = to_base_estimate(message)
        if estimate.t != self._base_stamp:
            self._base_stamp, now = estimate.t, self._clock()
            self.bus.publish(topics.BASE, replace(estimate, t=now), now)

    def _diagnose(self, now: float) -> None:
        """Say once a second how old everything is."""
        values: dict[str, object] = {"state": self.status.state, "steps per second": self._steps}
        self._steps = 0
        stamped: dict[str, Topic[Any]] = {
            "state": topics.LOW_STATE,
            "command": topics.LOW_CMD_REQUEST,
            "base estimate": topics.BASE,
            "e-stop": topics.ESTOP,
        }
        for name, topic in stamped.items():
            newest = self.bus.latest(topic)
            values[f"age of {name} [ms]"] = (
                "never seen" if newest is None else f"{(now - newest.t) * 1e3:.0f}"
            )
        values["on-board controller"] = self._switcher.owner or "none"
        level = DiagnosticStatus.ERROR if self.status.stopped else DiagnosticStatus.OK
        if self.status.state in (GateState.INIT, GateState.ARMED):
            level = DiagnosticStatus.WARN
        entry = diagnostic(level, "safety gate", describe_status(self.status), values)
        self._endpoints.publish("/diagnostics", diagnostics(now, [entry]))
