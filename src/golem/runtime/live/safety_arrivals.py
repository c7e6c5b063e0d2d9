"""What arrives at the safety process, stamped by its own clock.

Nobody else's clock can thereby make something old look new. The robot's time serves only to tell a new state from a
repeated one, and which state a command answers.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace

from golem.interfaces.payloads import Fault, Reason
from golem.middleware.dds.base import Sample
from golem.middleware.ros.waitset import WaitSet
from golem.middleware.wire import convert
from golem.middleware.wire.struct_layout import WireError
from golem.robots.model.table import JOINT_NAMES
from golem.runtime.live.clock import Rate, RobotClock
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.types import LowCommand, LowState

REMEMBERED = 256
"""States whose time of arrival is remembered: half a second."""
PERSISTENT = 25
"""States in a row with a motor's error that are a fault [own: as many as stop the legs for a speed]."""


class Arrivals:
    """The newest state and command, stamped with the time they arrived.

    Attributes:
        state, command: they, for the gate; None before the first.
        commands: what the process waits on.
        mode_machine: machine type that the robot reports; None before its first state.
        answered: robot time of the state that the newest command answers [s]; 0 where its sender does not say.
        rate: of the robot's time.
        sole: what reads each of the topics that one process alone may write.
    """

    def __init__(self, endpoints: RoleEndpoints, clock: Callable[[], float]) -> None:
        """Stamp by `clock` [s]."""
        self._clock = clock
        self.state: LowState | None = None
        self.command: LowCommand | None = None
        self._fault: Fault | None = None
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

    def take_fault(self) -> Fault | None:
        """Return what was wrong with the newest frame that was not sound, once."""
        fault, self._fault = self._fault, None
        return fault

    def _state(self, sample: Sample) -> None:
        now = self._clock()
        try:
            state = convert.decode_low_state(sample.payload)
        except WireError as error:
            self._fault = Fault(Reason.STATE_DAMAGED, str(error))
            return
        if not self._robot.advances(state.t, sample.writer):
            return
        self.mode_machine = convert.mode_machine(sample.payload)
        if self._robot.restarted:
            self._arrived.clear()
        self._arrived[state.t] = now
        self.rate.add(state.t, now)
        if len(self._arrived) > REMEMBERED:
            self._arrived.popitem(last=False)
        self.state = replace(state, t=now)
        errors = convert.motor_errors(sample.payload)
        self._faulty = self._faulty + 1 if errors else 0
        if self._faulty >= PERSISTENT:
            said = ", ".join(f"{JOINT_NAMES[i]} reports error {code:#x}" for i, code in errors.items())
            self._fault = Fault(Reason.MOTOR, said)

    def _command(self, sample: Sample) -> None:
        now = self._clock()
        try:
            command = convert.decode_low_command(sample.payload, now, self.mode_machine or 0)
            answered = convert.answered(sample.payload)
        except WireError as error:
            self._fault = Fault(Reason.COMMAND_DAMAGED, str(error))
            return
        if answered:
            # As old as the state it answers; one that answers a state nobody remembers is too old for anything.
            command = replace(command, t=self._arrived.get(answered, -math.inf))
        self.answered = answered
        self.command = command
