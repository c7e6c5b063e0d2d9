"""What the bring-up hears of a robot, and the little it says to one."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from golem.interfaces import public
from golem.interfaces.payloads import GateStatus
from golem.interfaces.ros_convert import time as time_message
from golem.interfaces.ros_convert import to_gate_status
from golem.middleware.dds import discovery
from golem.middleware.dds.base import Qos
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.ros import names
from golem.middleware.ros.codec import dds_name
from golem.middleware.ros.future import RosError
from golem.middleware.ros.msgs.rosgraph_msgs import Clock
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.pubsub import Publisher
from golem.middleware.ros.service import Client
from golem.middleware.wire import convert
from golem.middleware.wire.struct_layout import WireError
from golem.runtime.live.exclusive_writers import owner
from golem.runtime.live.motion_switcher_client import CALLS, MotionSwitcherClient
from golem.runtime.live.node_setup import ANSWER, SEARCH
from golem.runtime.live.operator import not_stopped
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.types import Array, LowCommand, LowState

KEPT = 5000
"""States that are remembered: 10 s."""
REST = 50
"""States in a row at rest that make a robot calm: 0.1 s."""
CALM = 0.05
"""Mean speed below which a joint counts as at rest [rad/s]."""
PERIOD = 0.002
"""Time between two looks for what has come [s]."""


class RobotLink:
    """A robot on a domain, seen by one who only listens until told otherwise.

    Attributes:
        states: the newest ones, oldest first, each with the time by our clock at which it came [s].
        damaged: states that could not be read.
        gate: newest verdict of the safety gate; None before the first.
        payload: the newest state as it came.
        stopped_at: when the gate was first heard to have stopped, by our clock [s]; None since it was set so.
    """

    def __init__(self, participant: CycloneParticipant, node: RosNode, dds: DdsConfig) -> None:
        """Listen through `participant` and `node` on the domain of `dds`."""
        self._participant, self.node, self._dds = participant, node, dds
        row = public.topic("/lowstate")
        self._reader = participant.reader(names.topic(row.name), dds_name(row.type), Qos(reliable=False, depth=256))
        self.states: deque[tuple[float, LowState]] = deque(maxlen=KEPT)
        self.damaged = 0
        self.gate: GateStatus | None = None
        self.payload: bytes = b""
        self.stopped_at: float | None = None
        self._switcher: MotionSwitcherClient | None = None
        self._commands: RoleEndpoints | None = None
        self._clients: dict[str, Client] = {}
        self._clock: Publisher | None = None
        status = public.topic("/safety/status")
        node.subscription(status.name, status.type, self._verdict, status.qos)

    @property
    def state(self) -> LowState | None:
        """The newest state."""
        return self.states[-1][1] if self.states else None

    def spin(
        self, seconds: float, until: Callable[[], bool] = lambda: False, every: Callable[[], None] | None = None
    ) -> bool:
        """Take what comes for `seconds`, or until `until()`; return whether it is. `every` is called each `PERIOD`."""
        end = time.monotonic() + seconds
        while not until():
            if time.monotonic() >= end:
                return False
            self.node.spin_once(PERIOD)
            self._take()
            if self._switcher is not None:
                self._switcher.poll()
            if every is not None:
                every()
        return True

    def pass_time(self, seconds: float, every: Callable[[], None] | None = None) -> None:
        """Take what comes until `seconds` of the robot's time are over, or twenty times as many of ours."""
        if not self.spin(20.0, lambda: bool(self.states), every):
            return
        end = self.states[-1][1].t + seconds
        self.spin(20.0 * seconds, lambda: self.states[-1][1].t >= end, every)

    def calm(self) -> bool:
        """Return whether every joint has been at rest for the newest `REST` states."""
        states = list(self.states)[-REST:]
        return len(states) == REST and float(np.abs([s.dq for _, s in states]).mean(axis=0).max()) < CALM

    def tell_time(self) -> None:
        """Publish the robot's time as /clock, which drivers of devices stamp with; `golem up` does it later."""
        state = self.state
        if state is None:
            return
        if self._clock is None:
            row = public.topic("/clock")
            self._clock = self.node.publisher(row.name, row.type, row.qos)
        self._clock.publish(Clock(time_message(state.t)))

    def listen(self, seconds: float) -> list[tuple[float, LowState]]:
        """Return the states of the next `seconds`, each with the time at which it came."""
        self.states.clear()
        self.spin(seconds)
        return list(self.states)

    def writers(self, topic: str) -> list[str]:
        """Return who writes a topic, ourselves left out."""
        found = discovery.writers(self._participant)
        mine = self._participant.guid
        return [
            owner(self._participant, w.guid) for w in found if w.topic == names.topic(topic) and w.participant != mine
        ]

    def others(self) -> int:
        """Return how many others are on the domain."""
        return len(discovery.others(self._participant))

    def switcher(self) -> MotionSwitcherClient:
        """Return the client that asks which of the robot's own controllers has the motors."""
        if self._switcher is None:
            endpoints = RoleEndpoints("safety", self._participant, self.node, only=(CALLS,))
            self._switcher = MotionSwitcherClient.on(endpoints, self.node.now)
        return self._switcher

    def ask(self, what: str, every: Callable[[], None] | None = None) -> str:
        """Ask the gate to `activate`, `stop` or `reset`; return its answer.

        `every` is called meanwhile as by `spin`. Raises RosError: there is none, or it does not answer.
        """
        service = f"/safety/{what}"
        client = self._clients.get(service)
        if client is None:
            client = self._clients[service] = self.node.client(service, public.TRIGGER)
        if not self.spin(SEARCH, client.ready, every):
            start = f"Nobody offers '{service}'; start it with: {self._dds.command('safety')}."
            raise RosError(not_stopped(self._dds) if what == "stop" else start)
        answer = client.call(Trigger_Request())
        if not self.spin(ANSWER, lambda: answer.done, every):
            raise RosError(not_stopped(self._dds) if what == "stop" else f"'{service}' does not answer.")
        return str(answer.result().message)

    def command(self, q: Array, kp: Array, kd: Array) -> None:
        """Send the gate a command that answers the newest state: (27,) each [rad], [N m/rad], [N m s/rad]."""
        state = self.state
        if state is None:
            return
        if self._commands is None:
            self._commands = RoleEndpoints("stack", self._participant, self.node, only=("/safety/lowcmd_in",))
        zero = np.zeros_like(q)
        command = LowCommand(t=state.t, q=q, dq=zero, tau=zero, kp=kp, kd=kd)
        machine = convert.mode_machine(self.payload)
        self._commands.publish("/safety/lowcmd_in", convert.encode_low_command(command, machine, state.t))

    def _take(self) -> None:
        now = time.monotonic()
        for sample in self._reader.take(256):
            if not sample.alive:
                continue
            try:
                state = convert.decode_low_state(sample.payload)
            except WireError:
                self.damaged += 1
                continue
            if not self.states or state.t != self.states[-1][1].t:
                self.states.append((now, state))
                self.payload = sample.payload

    def _verdict(self, message: Any) -> None:
        self.gate = to_gate_status(message)
        if self.gate.stopped and self.stopped_at is None:
            self.stopped_at = time.monotonic()
