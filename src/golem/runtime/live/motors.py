"""Motor states and commands between the bus of a process and the robot's own wire."""

from __future__ import annotations

from collections.abc import Callable

from golem.middleware import topics
from golem.middleware.bus import Bus, News
from golem.middleware.dds.base import Sample
from golem.middleware.ros.waitset import WaitSet
from golem.middleware.wire.convert import decode_low_command, encode_low_command, encode_low_state
from golem.middleware.wire.layout import WireError
from golem.runtime.executor import TICK
from golem.runtime.live.surface import Surface
from golem.types import LowCommand, LowState


class StateOut:
    """Sends every state of the robot."""

    period = TICK

    def __init__(self, bus: Bus, surface: Surface) -> None:
        """Send what is on `bus`."""
        self._bus, self._writer = bus, surface.writer("/lowstate")

    def step(self, t: float) -> None:
        """Send the present state."""
        state = self._bus.latest(topics.LOW_STATE, LowState)
        if state is not None:
            self._writer.write(encode_low_state(state))


class CommandIn:
    """Takes what the motors are told, as the robot does: what is damaged or for another machine is ignored.

    Attributes:
        ignored: how many commands were.
        why: the reason of the last one.
    """

    period = TICK

    def __init__(self, bus: Bus, surface: Surface) -> None:
        """Bring commands to `bus`."""
        self._bus = bus
        self._t = 0.0
        self.ignored, self.why = 0, ""
        self._waitset = WaitSet()
        self._inbox = surface.receive("/lowcmd", self._waitset, self._take)

    def step(self, t: float) -> None:
        """Take what has come."""
        self._t = t
        self._waitset.poll()

    def _take(self, sample: Sample) -> None:
        try:
            command = decode_low_command(sample.payload, self._t)
        except WireError as error:
            self.ignored, self.why = self.ignored + 1, str(error)
            return
        self._bus.publish(topics.LOW_CMD, command, self._t)


class RequestOut:
    """Sends what the stack wants of the motors to the safety gate."""

    period = TICK

    def __init__(self, bus: Bus, surface: Surface, mode_machine: Callable[[], int]) -> None:
        """Send what is on `bus`; `mode_machine()` is the machine type that the robot reports."""
        self._writer, self._mode_machine = surface.writer("/safety/lowcmd_in"), mode_machine
        self._commands = News(bus, topics.LOW_CMD_REQUEST, LowCommand)

    def step(self, t: float) -> None:
        """Send a new command, with the time of the state it answers."""
        command = self._commands.read()
        if command is not None:
            self._writer.write(encode_low_command(command, self._mode_machine(), answers=t))
