"""What arrives at the safety process, stamped by its own clock.

Nobody else's clock can thereby make something old look new. The robot's time serves only to tell a new state from a
repeated one, how far apart two states are, and which state a command answers.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable

from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.motor_reports import EVERY, MotorReports, MotorWatch
from golem.interfaces.payloads import Fault, Reason
from golem.middleware.dds.base import Payload, Sample
from golem.middleware.ros.waitset import WaitSet
from golem.middleware.wire import convert, hg
from golem.middleware.wire.struct_layout import WireError
from golem.runtime.live.clock import BACK, Rate, RobotClock
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.types import LowCommand, LowState

REMEMBERED = 256
"""States whose time of arrival is remembered: half a second."""


class DamagedFrames:
    """Counts damaged frames of one stream: one is dropped, a run of them is a fault."""

    def __init__(self, limits: SafetyLimits) -> None:
        self._most, self._leak, self._level = limits.bad_frames, limits.frame_leak, 0.0
        self.dropped = 0

    def bad(self) -> bool:
        """Count one; return whether there are too many."""
        self.dropped += 1
        self._level = min(self._level + 1.0, self._most)
        return self._level >= self._most

    def good(self) -> None:
        """Take note of a sound one."""
        if self._level:
            self._level = max(0.0, self._level - self._leak)


class Arrivals:
    """The newest state and command, stamped with the time they arrived.

    Attributes:
        state, command: they, for the gate; None before the first.
        commands: what the process waits on.
        mode_machine: machine type that the robot reports; None before its first state.
        answered: robot time of the state that the newest command answers [s]; 0 where its sender does not say.
        rate: of the robot's time.
        tick: the robot's own time of `state` [s].
        ignored: handles of the writers of commands that are not heard.
        damaged: damaged frames, by topic.
        sole: what reads each of the topics that one process alone may write.
    """

    def __init__(
        self,
        endpoints: RoleEndpoints,
        clock: Callable[[], float],
        limits: SafetyLimits,
        observe: Callable[[str, Payload, float], None] | None = None,
    ) -> None:
        """Stamp by `clock` [s], compare with `limits`, and show every frame to `observe`, sound or not."""
        self._observe = observe
        self._clock = clock
        self.tick = 0.0
        self.damaged = {name: DamagedFrames(limits) for name in ("/lowstate", "/safety/lowcmd_in")}
        self._motors, self._count = MotorWatch(limits), 0
        self.state: LowState | None = None
        self.command: LowCommand | None = None
        self._faults = list[Fault]()
        self._earlier = list[tuple[float, LowState]]()
        self._arrived: OrderedDict[float, float] = OrderedDict()
        self.commands, self._states = WaitSet(), WaitSet()
        self.mode_machine: int | None = None
        self.answered = 0.0
        self.ignored: frozenset[int] = frozenset()
        self.rate = Rate()
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

    def take_faults(self) -> list[Fault]:
        """Return all that was wrong with the frames since the last call."""
        faults, self._faults = self._faults, []
        return faults

    def take_earlier(self) -> tuple[tuple[float, LowState], ...]:
        """Return the sound states since the last call but the newest one, each with its tick."""
        earlier, self._earlier = self._earlier[:-1], []
        return tuple(earlier)

    def _state(self, sample: Sample) -> None:
        now = self._clock()
        if self._observe is not None:
            self._observe("/lowstate", sample.payload, now)
        try:
            state = convert.decode_low_state(sample.payload)
        except WireError as error:
            if self.damaged["/lowstate"].bad():
                self._faults.append(Fault(Reason.STATE_DAMAGED, str(error)))
            return
        self.damaged["/lowstate"].good()
        known, before, heard = self._robot.known, self._robot.t, self._robot.heard
        if not self._robot.advances(state.t, sample.writer):
            return
        ahead = (state.t - before) - (now - heard)
        if known and (self._robot.restarted or ahead > BACK):
            said = f"by {state.t - before:+.3f} s in {now - heard:.3f} s"
            self._faults.append(Fault(Reason.STATE_JUMPED, said))
        if self._robot.restarted:
            self._arrived.clear()
        machine = convert.mode_machine(sample.payload)
        if self.mode_machine not in (None, machine):
            said = f"mode_machine changed from {self.mode_machine} to {machine}"
            self._faults.append(Fault(Reason.MOTOR_MODE, said))
        self.mode_machine = machine
        self._arrived[state.t] = now
        self.rate.add(state.t, now)
        if len(self._arrived) > REMEMBERED:
            self._arrived.popitem(last=False)
        # Not by `replace`, which takes ten times as long; so below.
        self.state, self.tick = LowState(now, state.q, state.dq, state.tau, state.imu), state.t
        self._earlier.append((self.tick, self.state))
        self._count += 1
        reports = _reports(sample.payload)
        fault = self._motors.add(reports) if self._count % EVERY == 0 else self._motors.gather(reports)
        if fault is not None:
            self._faults.append(fault)

    def _command(self, sample: Sample) -> None:
        now = self._clock()
        if self._observe is not None:
            self._observe("/safety/lowcmd_in", sample.payload, now)
        if sample.writer in self.ignored:
            return
        try:
            command = convert.decode_low_command(sample.payload, now, self.mode_machine or 0)
            answered = convert.answered(sample.payload)
        except WireError as error:
            if self.damaged["/safety/lowcmd_in"].bad():
                self._faults.append(Fault(Reason.COMMAND_DAMAGED, str(error)))
            return
        self.damaged["/safety/lowcmd_in"].good()
        if not answered:
            said = "reserve[0] is 0: copy the tick of the state it answers"
            self._faults.append(Fault(Reason.COMMAND_UNSTAMPED, said))
            return
        # As old as the state it answers; one that answers a state nobody remembers is too old for anything.
        self.answered = answered
        t = self._arrived.get(answered, -math.inf)
        self.command = LowCommand(t, command.q, command.dq, command.tau, command.kp, command.kd)


def _reports(payload: Payload) -> MotorReports:
    mode, error, temperature, voltage = convert.motor_columns(payload)
    return MotorReports(mode == hg.ENABLE, error, temperature, voltage)
