"""The safety process: the emergency stop and the gate, on a monotonic clock of their own.

The lease for the motors' commands goes to the one that writes when the gate is activated, and ends with that process.
While another writes, too, the robot stops and cannot be activated: one of the two has to end, or an operator hands over
on purpose.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from golem.hardware.estop.base import EmergencyStop
from golem.hardware.estop.estop_config import VirtualEstop
from golem.hardware.safety.base import GateInputs, OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import Gate, passive
from golem.hardware.safety.standing_gate import StandingController, StandingGate
from golem.interfaces.payloads import EstopMessage, Fault, GateState, GateStatus, Reason
from golem.interfaces.ros_convert import diagnostic, diagnostics
from golem.middleware.dds.base import Participant, Qos, Sample
from golem.middleware.ros.msgs.diagnostic_msgs import DiagnosticStatus
from golem.middleware.ros.msgs.std_srvs import SetBool_Request, SetBool_Response, Trigger_Response
from golem.middleware.ros.node import RosNode
from golem.middleware.wire import convert
from golem.runtime.live import sim_sync
from golem.runtime.live.clock import Every, Rate, time_since_boot
from golem.runtime.live.motion_switcher_client import MotionSwitcherClient
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.safety_arrivals import Arrivals
from golem.runtime.live.safety_status import StatusReports, describe_status
from golem.types import BaseEstimate, LowCommand

if TYPE_CHECKING:
    from golem.runtime.live.black_box import BlackBox


class CommandLease:
    """Who holds the lease on one topic.

    Attributes:
        holder: guid of the writer whose commands are let through; None before the first activation and after its end.
        ignored: handles of the writers that are heard no more since an operator handed over.
    """

    def __init__(self, topic: str, writers: Callable[[], Mapping[int, bytes]], who: Callable[[bytes], str]) -> None:
        """Look after `topic`, whose `writers` are guids by handle; `who` names the owner of one."""
        self._topic, self._writers, self._who = topic, writers, who
        self.holder: bytes | None = None
        self.ignored: frozenset[int] = frozenset()

    def doubt(self, moving: bool) -> str:
        """Return what speaks against letting commands through; empty if nothing does.

        If `moving`, commands pass now, and nobody has asked for a change of the writer.
        """
        present = self._present()
        if len(present) > 1:
            names = ", ".join(map(self._who, present))
            return f"{self._topic} is written by {len(present)}: {names}; end one, or: golem safety hand-over"
        if self.holder is not None and self.holder not in present:
            if moving and present:
                return f"{self._topic} is now written by {self._who(present[0])}, which nobody has activated"
            if not moving:
                self.holder = None
        return ""

    def grant(self) -> None:
        """Give the lease to the one that writes now: the gate was activated."""
        present = self._present()
        self.holder = present[0] if len(present) == 1 else None

    def hand_over(self) -> str:
        """Give the lease to the other of two that write; return whose it is now, or an empty string if nobody's."""
        handles = {guid: handle for handle, guid in self._writers().items() if handle not in self.ignored}
        others = [guid for guid in handles if guid != self.holder]
        if self.holder not in handles or len(others) != 1:
            return ""
        self.ignored |= {handles[self.holder]}
        self.holder = others[0]
        return self._who(self.holder)

    def _present(self) -> list[bytes]:
        writers = self._writers()
        self.ignored &= writers.keys()
        return [guid for handle, guid in writers.items() if handle not in self.ignored]


LOOK = 0.05
"""Time between two looks for other writers of the motors' command [s]."""
WARY = 1.0
"""Time after a pause of the gate in which it is asked for nothing but a stop [s]."""
FOREIGN = 0.1
"""Time for which a command of another writer counts as reaching the motors [s]: their drives go limp without one."""
DIAGNOSE = 1.0
"""Time between two diagnostics [s]."""


class SafetyProcess:
    """The safety process without its loop.

    Attributes:
        commands: what to wait on between two steps.
        command: what the gate told the motors last; None before it ran.
    """

    def __init__(
        self,
        participant: Participant,
        node: RosNode,
        limits: SafetyLimits,
        estop: EmergencyStop | None,
        clock: Callable[[], float] = time_since_boot,
        who: Callable[[bytes], str] = bytes.hex,
        patient: bool = False,
        real: bool = False,
        standing: Callable[[], StandingController] | None = None,
        black_box: BlackBox | None = None,
        senders: Callable[[], Sequence[str]] = tuple,
    ) -> None:
        """Guard the robot on the domain.

        Args:
            estop: the emergency stop. None where a real one belongs: until there is one, the gate stays shut.
            clock: monotonic [s].
            who: names the owner of an endpoint by its guid.
            patient: whether the robot's time may stand still for a stack that is behind; see `live.sim_sync`.
            real: whether the robot's own controllers must have let go of the motors first; a twin's move none. Its
                motors must hear us then, and its time must run as ours does; that of a twin stands still at times.
            standing: makes what the legs are given to where a stop leaves them and the state sound; None damps.
            black_box: keeps what happened around each stop; None keeps nothing.
            senders: names who writes what moves the robot and is none of ours, at once.
        """
        if patient:
            limits = sim_sync.relaxed_limits(limits)
        self._patient, self._damping, self._stall = patient, limits.damping, limits.stall
        self._estop_age, self._frozen = limits.estop_age, limits.frozen > 0.0
        self._reset_after = limits.reset_after
        self._node, self._clock, self._who = node, clock, who
        self._endpoints = endpoints = RoleEndpoints("safety", participant, node)
        self._arrivals = Arrivals(endpoints, clock, limits, None if black_box is None else black_box.add)
        self._black_box, self._senders = black_box, senders
        self.commands = self._arrivals.commands
        self._lease = CommandLease("/safety/lowcmd_in", self._arrivals.sole["/safety/lowcmd_in"].writers, who)
        self._out = endpoints.writer("/lowcmd")
        # Best effort, as the robot's own reader may be: a reliable one does not see writers that are.
        self._all_commands = endpoints.reader("/lowcmd", Qos(reliable=False, depth=8))
        self._switcher, self._real = MotionSwitcherClient.on(endpoints, clock), real
        self._gate, self._estop = StandingGate(Gate(limits), standing), estop
        self._gate.prepare()
        self._frame: EstopMessage | None = None
        self._base: BaseEstimate | None = None
        self._base_stamp = -math.inf
        self._crowded, self._unheard = "", ""
        self._listeners: set[bytes] | None = None
        self._foreign, self._had = -math.inf, False
        self._looks, self._diagnoses, self._reports = Every(LOOK), Every(DIAGNOSE), StatusReports(endpoints)
        self._steps = 0
        self._ending, self._halts = False, False
        self._stepped, self._paused_until = clock(), -math.inf
        self.status = GateStatus(clock(), GateState.INIT)
        self.command: LowCommand | None = None
        endpoints.listen("/base_estimate", self._take_base)
        endpoints.serve(
            {
                "/safety/activate": lambda _: self._ask(OperatorRequest.ACTIVATE, GateState.ACTIVE),
                "/safety/stop": lambda _: self._ask(OperatorRequest.STOP, GateState.STOP1, GateState.STOP0),
                "/safety/reset": lambda _: self._ask(OperatorRequest.RESET, GateState.ARMED),
                "/safety/hand_over": lambda _: self._hand_over(),
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
        if self._crowded and any(self._is_foreign(sample) for sample in self._all_commands.take(8)):
            self._foreign = now
        ends = self._ending and self.status.state is not GateState.ARMED  # that is no stop for the black box
        self._judge(OperatorRequest.STOP if ends else OperatorRequest.NONE)
        if self._diagnoses.due(now):
            self._diagnose(now)

    def stop(self) -> bool:
        """Ask for a stop, and return whether the gate has done damping, if it had anything to damp."""
        self._ending = True
        self.step()
        over = self.status.state not in (GateState.ACTIVE, GateState.STOP2, GateState.STOP1)
        if over and self._black_box is not None:
            self._black_box.flush()
        return over

    def damp(self) -> None:
        """Tell the motors to damp, whatever may have failed."""
        self._tell(passive(self._clock(), None, self._damping))

    def _judge(self, request: OperatorRequest = OperatorRequest.NONE) -> None:
        """Run the gate once, under what an operator asks for, and publish what follows."""
        now, before = self._clock(), self.status
        moving = before.state is GateState.ACTIVE
        frame = None if self._estop is None else self._estop.step(now)
        self._frame = frame or self._frame
        # An activation is for a gate that was armed when it was asked.
        early = request is OperatorRequest.ACTIVATE and before.state is GateState.INIT
        result = self._gate.step(
            GateInputs(
                now,
                self._arrivals.state,
                self._arrivals.command,
                self._frame,
                OperatorRequest.NONE if early else request,
                self._base,
                tuple(self._transport(moving)),
                self._arrivals.tick,
                earlier=self._arrivals.take_earlier(),
            )
        )
        if result.state is GateState.ACTIVE and not moving:
            self._lease.grant()
        self._steps += 1
        self.command = result.command
        strangers = "" if result.reason else "; ".join(self._senders())
        detail = f"no fault; unknown senders: {strangers}" if strangers else result.detail
        self.status = status = GateStatus(now, result.state, result.reason, detail)
        if status.stopped and now - self._foreign < FOREIGN:
            # To say "stopped" would be to lie: the motors follow whoever wrote last.
            detail = f"ALARM, the motors get another's commands; stopped for {status.why}"
            self.status = status = GateStatus(now, result.state, Reason.NOT_IN_CONTROL, detail)
        if self._black_box is not None:
            self._black_box.judge(before, status)
        self._halts = moving and status.state is not GateState.ACTIVE
        waited_for = self._patient and status.state is GateState.ACTIVE
        self._tell(result.command, self._arrivals.answered if waited_for else 0.0)
        if frame is not None:
            self._endpoints.send("/estop", frame)
        self._reports.add(status)

    def _transport(self, moving: bool) -> list[Fault]:
        """Return all that is wrong with the transport: what holds now, and what came since the gate last ran."""
        faults = self._arrivals.take_faults()
        if self._crowded:
            # Of two stacks, or two writers of commands, neither touches what the robot measures.
            faults.append(Fault(Reason.WRITERS, self._crowded, not self._crowded.startswith("/lowstate")))
        doubts = [(Reason.ESTOP_MISSING if self._frame is None else Reason.ESTOP_STALE, self._estop_fault())]
        if self._real:
            # A robot that moves is not dropped for its clock: the unit was right, and what arrives may be late.
            clock = "" if moving or self._arrivals.mode_machine is None else self._arrivals.rate.doubt()
            held = self._switcher.doubt(moving)
            doubts += [(Reason.STATE_CLOCK, clock), (Reason.UNHEARD, self._unheard), (Reason.HELD, held)]
        faults += [Fault(reason, detail) for reason, detail in doubts if detail]
        return faults[::-1]  # of two that are alike the later tells an operator more

    def _estop_fault(self) -> str:
        """Return what the emergency stop says is wrong with it, once the gate counts it as silent."""
        old = self._frame is None or self._clock() - self._frame.t > self._estop_age
        return self._estop.fault if old and self._estop is not None else ""

    def _tell(self, command: LowCommand, answers: float = 0.0) -> None:
        """Write `command` to the motors, unless the robot's own controllers have them or a shut gate never had them.

        What it had it goes on damping: a button that is pressed before the activation does not leave motors alone.

        Whoever gets them from a robot in motion gets them damped once: until they speak our last command stands. While
        the robot moves and is damped only an answer says that they have: drives that hear nothing may go on with the
        last command. Once it is limp, as after a reboot, silence says so, too.
        """
        state, switcher, machine = self.status.state, self._switcher, self._arrivals.mode_machine
        shut = state is GateState.INIT
        limp = shut or state is GateState.STOP0
        theirs = self._real and bool(switcher.owner or (limp and not switcher.free)) and not self._halts
        self._had = not theirs and (self._had or not shut)
        if machine is not None and self._had:
            command = passive(command.t, self._arrivals.state, self._damping) if shut else command
            payload = convert.encode_low_command(command, machine, answers)
            self._out.write(payload)
            if self._black_box is not None:
                self._black_box.add("/lowcmd", payload, self._clock())

    def _is_foreign(self, sample: Sample) -> bool:
        return sample.alive and self._all_commands.writers().get(sample.writer) != self._out.guid

    def _crowd(self) -> str:
        """Return who else writes what one process alone may write; empty if nobody does."""
        others = [g for g in self._all_commands.writers().values() if g != self._out.guid]
        if others:
            return f"/lowcmd is also written by {self._names(others)}"
        states = list(self._arrivals.sole["/lowstate"].writers().values())
        if len(states) > 1:
            return f"/lowstate is written by {len(states)}: {self._names(states)}"
        return self._lease.doubt(self.status.state in (GateState.ACTIVE, GateState.STOP2))

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
        self._judge(request)
        said, done = describe_status(self.status), self.status.state in wanted
        if request is OperatorRequest.RESET and self.status.stopped:
            done = self.status.reason is None  # the gate's own legs go on standing until the activation
            rest = f"{self._reset_after:g} s since the stop, and a robot at rest"
            said += "" if done else f"; a reset needs the button released, no fault, {rest}"
        if request is OperatorRequest.ACTIVATE and not done:
            said += "; reset it first" if self.status.stopped else "; mend that, then activate again"
        return Trigger_Response(done, said)

    def _hand_over(self) -> Trigger_Response:
        """Let the other of two stacks have the lease for commands; a robot that moves has to be stopped first."""
        if self.status.state is GateState.ACTIVE:
            return Trigger_Response(False, "The robot is in motion; stop it first: golem safety stop.")
        name = self._lease.hand_over()
        if not name:
            return Trigger_Response(False, "There are no two stacks of which one has the lease.")
        self._arrivals.ignored = self._lease.ignored
        return Trigger_Response(True, f"The commands are those of {name} now; reset, then activate.")

    def _press(self, request: SetBool_Request) -> SetBool_Response:
        if not isinstance(self._estop, VirtualEstop):
            return SetBool_Response(False, "This emergency stop is not virtual: press the button.")
        (self._estop.press if request.data else self._estop.release)()
        return SetBool_Response(True, "pressed" if request.data else "released")

    def _take_base(self, estimate: BaseEstimate) -> None:
        if estimate.t != self._base_stamp:
            self._base_stamp = estimate.t
            self._base = replace(estimate, t=self._clock())

    def _diagnose(self, now: float) -> None:
        values: dict[str, object] = {"state": self.status.state, "steps per second": self._steps}
        self._steps = 0
        newest = {
            "state": self._arrivals.state,
            "command": self._arrivals.command,
            "base estimate": self._base,
            "e-stop": self._frame,
        }
        for name, frame in newest.items():
            values[f"age of {name} [ms]"] = "never seen" if frame is None else f"{(now - frame.t) * 1e3:.0f}"
        for name, frames in self._arrivals.damaged.items():
            values[f"damaged frames of {name}"] = frames.dropped
        values["check of sensors that stand still"] = "on" if self._frozen else "off: declared still"
        values["unknown senders"] = "; ".join(self._senders()) or "none"
        values["on-board controller"] = self._switcher.owner or "none"
        level = DiagnosticStatus.ERROR if self.status.stopped else DiagnosticStatus.OK
        if self.status.state in (GateState.INIT, GateState.ARMED):
            level = DiagnosticStatus.WARN
        entry = diagnostic(level, "safety gate", describe_status(self.status), values)
        self._endpoints.publish("/diagnostics", diagnostics(now, [entry]))
