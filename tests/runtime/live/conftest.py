"""Twin, safety gate and stack as three members of a domain inside one process, in simulated time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from golem.hardware.estop.base import EmergencyStop
from golem.hardware.estop.estop_config import VirtualEstop
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces.payloads import GateState
from golem.middleware.dds.local import LocalDomain, LocalParticipant
from golem.middleware.ros.msgs.std_srvs import SetBool_Request, Trigger_Request
from golem.middleware.ros.node import RosNode
from golem.runtime.live.safety_process import SafetyProcess
from golem.runtime.live.stack_process import StackProcess
from golem.runtime.live.twin import Twin
from golem.runtime.lockstep import build_robot
from golem.stack import Choice, Stack
from golem.types import TICK

BLIND = """
class Blind:
    latency = 0.0
    def locate(self, frame, labels):
        return []
"""


@dataclass
class Live:
    """The three processes without their loops; any of them may be None."""

    stack: Stack
    domain: LocalDomain = field(default_factory=LocalDomain)
    clock: float = 1000.0
    twin: Twin | None = None
    gate: SafetyProcess | None = None
    up: StackProcess | None = None
    robot: Any = None
    members: list[tuple[LocalParticipant, RosNode]] = field(default_factory=list)

    def member(self, name: str) -> tuple[LocalParticipant, RosNode]:
        """Return a new participant and its node."""
        participant = self.domain.participant()
        node = RosNode(participant, name)
        self.members.append((participant, node))
        return participant, node

    def start_twin(self, seed: int = 0) -> None:
        """Put a new robot on the domain."""
        self.robot = build_robot(self.stack, seed)
        # In this one process nobody could answer while the twin waits.
        self.twin = Twin(self.stack, self.robot, *self.member("twin"), patience=0.0)

    def start_gate(self, patient: bool = False, real: bool = False, estop: EmergencyStop | None = None) -> None:
        """Put a new gate on the domain, with a virtual e-stop if none is given."""
        limits = SafetyLimits.from_profile(self.stack.limits).still()
        estop = estop or VirtualEstop()
        self.gate = SafetyProcess(
            *self.member("safety"), limits, estop, clock=lambda: self.clock, patient=patient, real=real
        )

    def start_up(self, real: bool = False) -> None:
        """Put a new stack on the domain."""
        self.up = StackProcess(self.stack, *self.member("up"), real=real, clock=lambda: self.clock)

    def leave(self, node: str) -> None:
        """Take a process off the domain, as if it had been killed."""
        for member in self.members:
            if member[1].name == node:
                member[0].close()
                self.members.remove(member)
                break
        if node == "twin":
            self.twin = None
            self.robot.close()
        elif node == "safety":
            self.gate = None
        else:
            self.up = None

    def run(self, seconds: float, stop: Callable[[], bool] = lambda: False) -> None:
        """Let time pass, until `stop()`."""
        end = self.clock + seconds
        while self.clock < end - 1e-9 and not stop():
            if self.twin is not None:
                self.twin.executor.step()
            if self.up is not None:
                self.up.step()
            if self.gate is not None:
                self.gate.step()
            self.clock += TICK

    def ask(self, what: str) -> tuple[bool, str]:
        """Call one of the gate's services, or another by its whole name; return success and message."""
        _, node = self.member("operator")
        press = what in ("press", "release")
        name, kind = ("/estop/press", "SetBool") if press else (f"/safety/{what}", "Trigger")
        name = what if what.startswith("/") else name
        request = SetBool_Request(what == "press") if press else Trigger_Request()
        answer = node.client(name, f"std_srvs/srv/{kind}").call(request)
        for _ in range(50):
            self.run(TICK)
            node.poll()
            if answer.done:
                break
        self.leave_quietly(node)
        response = answer.result()
        return response.success, response.message

    def reset(self) -> None:
        """Wait for a second after a stop, and for rest, and have the gate armed again at the first request."""
        self.run(1.0)
        self.run(5.0, self._rests)
        assert self.ask("reset") == (True, "armed")

    def _rests(self) -> bool:
        state = self.gate and self.gate._arrivals.state
        return bool(state and np.abs(state.imu.gyro).max() < 0.2 and np.abs(state.dq).max() < 0.5)

    def leave_quietly(self, node: RosNode) -> None:
        """Take a member off the domain that is none of the three processes."""
        for member in self.members:
            if member[1] is node:
                node.close()
                member[0].close()
                self.members.remove(member)
                return

    def activate(self) -> None:
        """Wait for a stack that speaks, and let its commands through."""
        self.run(0.1)
        success, message = self.ask("activate")
        assert success, message
        assert self.state is GateState.ACTIVE

    @property
    def state(self) -> GateState:
        """Where the gate is."""
        assert self.gate is not None
        return self.gate.status.state

    @property
    def reason(self) -> str:
        """Why."""
        assert self.gate is not None
        return self.gate.status.reason or ""

    def close(self) -> None:
        """Take everybody off the domain."""
        for participant, _ in self.members:
            participant.close()
        if self.robot is not None:
            self.robot.close()


@pytest.fixture
def live(tmp_path: Any) -> Iterator[Live]:
    """A hanging robot that sees nothing: twin, gate and stack."""
    (tmp_path / "blind.py").write_text(BLIND)
    robot = Choice("mujoco", {"world": "open"})
    choices = {"robot": robot, "localizer": Choice(f"{tmp_path / 'blind.py'}:Blind")}
    stack = Stack(choices, profile="ideal")
    live = Live(stack)
    live.start_twin()
    live.start_gate()
    live.start_up()
    yield live
    live.close()
