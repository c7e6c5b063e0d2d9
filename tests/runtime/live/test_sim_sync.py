"""A robot whose stack is slow has slow time, not an old command; one whose stack is gone goes on."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from tests.runtime.live.conftest import Live

from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import topics
from golem.interfaces.payloads import GateState
from golem.middleware.bus import Bus
from golem.middleware.dds.base import Qos, Writer
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.node import RosNode
from golem.middleware.wire import hg
from golem.middleware.wire.convert import answered, encode_low_command
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.sim_sync import LAG, PATIENCE, SILENCE, relaxed_limits
from golem.runtime.live.twin import CommandIn
from golem.types import NUM_JOINTS, TICK, LowCommand

LONG = 100.0
"""Patience that no test outlasts [s]."""


class Drives:
    """The robot's end of the command, and who sends it."""

    def __init__(self, patience: float) -> None:
        domain = LocalDomain()
        robot, safety = domain.participant(), domain.participant()
        self.bus = Bus()
        self.commands = CommandIn(self.bus, RoleEndpoints("robot", robot, RosNode(robot, "twin")), print, patience)
        self._writer: Writer = RoleEndpoints("safety", safety, RosNode(safety, "safety")).writer("/lowcmd")

    def send(self, answers: float, kp: float = 0.0) -> None:
        """Send a command that answers the state of a time [s]."""
        zeros = np.zeros(NUM_JOINTS)
        command = LowCommand(0.0, zeros, zeros, zeros, np.full(NUM_JOINTS, kp), zeros)
        self._writer.write(encode_low_command(command, 0, answers))

    def stiffness(self) -> float:
        """Return the gain of the newest command."""
        command = self.bus.latest(topics.LOW_CMD)
        assert command is not None
        return float(command.kp[0])


def test_time_stands_still_until_a_state_long_past_is_answered() -> None:
    drives = Drives(patience=LONG)
    drives.send(answers=1.0, kp=1.0)
    drives.commands.step(1.0 + LAG)  # near enough: at once
    assert drives.stiffness() == 1.0
    later = threading.Timer(0.05, lambda: drives.send(answers=1.0 + TICK, kp=2.0))
    later.start()
    drives.commands.step(1.0 + LAG + TICK)
    assert drives.stiffness() == 2.0
    later.join()


@pytest.mark.parametrize("answers", [0.0, 50.0])
def test_nobody_is_waited_for_who_does_not_say_what_he_answers_or_answered_another_robot(answers: float) -> None:
    drives = Drives(patience=LONG)
    drives.send(answers, kp=1.0)
    for k in range(1000):
        drives.commands.step(1.0 + k * TICK)
    assert drives.stiffness() == 1.0


def test_a_stack_that_was_waited_for_in_vain_is_waited_for_once() -> None:
    drives = Drives(patience=0.1)
    drives.send(answers=1.0)
    begin = time.monotonic()
    for k in range(1000):
        drives.commands.step(1.0 + k * TICK)
    assert 0.1 <= time.monotonic() - begin < 10.0


@pytest.mark.parametrize("patient", [True, False])
def test_only_a_patient_gate_that_is_active_says_what_its_commands_answer(live: Live, patient: bool) -> None:
    live.leave("safety")
    live.start_gate(patient)
    watcher, _ = live.member("watcher")
    reader = watcher.reader("rt/lowcmd", hg.LOW_CMD.type_name, Qos(depth=1))
    live.run(0.1)
    assert live.state is GateState.ARMED
    assert [answered(sample.payload) for sample in reader.take()] == [0.0]
    live.activate()
    live.run(0.1)
    assert live.twin is not None
    (newest,) = reader.take()
    assert answered(newest.payload) == pytest.approx(live.twin.executor.t - TICK if patient else 0.0)


def test_the_gate_is_more_patient_than_the_robot_and_otherwise_as_strict() -> None:
    strict = SafetyLimits.from_profile()
    lenient = relaxed_limits(strict)
    assert min(lenient.state_age, lenient.hung) > SILENCE > PATIENCE
    assert lenient.estop_age == strict.estop_age and lenient.velocity is strict.velocity


def test_of_a_robot_that_is_gone_the_state_is_missed_and_not_the_command_that_answers_an_older_one(live: Live) -> None:
    live.leave("safety")
    live.start_gate(patient=True)
    live.activate()
    live.leave("up")
    live.run(LAG)
    live.leave("twin")
    live.run(SILENCE + 1.0, lambda: live.state is not GateState.ACTIVE)
    assert live.reason.startswith("state_stale")
