"""A robot, a gate and a stack that share nothing but a domain: they find each other, move, stop, and come back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.runtime.live.conftest import Live

from golem.hardware.safety.base import GateInputs, OperatorRequest
from golem.hardware.safety.memory import GateResult
from golem.interfaces.payloads import GateState, Reason
from golem.middleware.dds.base import Qos
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.wire import hg
from golem.middleware.wire.convert import encode_low_command
from golem.types import COMMAND_AGE, NUM_JOINTS, TICK, LowCommand

VENDOR = Qos(depth=1)
"""What the vendor's clients offer."""


def stiff(live: Live) -> bool:
    """Return whether the motors of the robot hold a position."""
    assert live.gate is not None
    command = live.gate.command
    return command is not None and bool(command.kp.any())


def torque(live: Live) -> float:
    """Return the largest torque of a motor [N m]."""
    return float(np.abs(live.robot.joints()[2]).max())


def test_commands_pass_once_the_gate_is_activated(live: Live) -> None:
    live.run(0.1)
    assert live.state is GateState.ARMED and not stiff(live)
    live.activate()
    live.run(0.5)
    assert live.state is GateState.ACTIVE and stiff(live) and torque(live) > 1.0
    assert live.twin is not None and live.up is not None
    assert live.twin.commands.refused.count == 0 and live.up.refused.count == 0


def test_a_stack_that_dies_is_noticed_and_the_robot_damped_then_it_comes_back(live: Live) -> None:
    live.activate()
    live.leave("up")
    live.run(0.2)
    assert (live.state, live.reason) == (GateState.STOP1, "command_stale") and not stiff(live)
    assert live.gate is not None
    command = live.gate.command
    assert command is not None and (command.kd > 0.0).all()
    live.start_up()
    live.run(0.1)
    assert live.state is GateState.STOP1  # latched, whatever comes back
    agreed, said = live.ask("activate")
    assert not agreed and said.endswith("; reset it first")
    live.reset()
    assert live.ask("activate") == (True, "active")


def test_drives_go_limp_when_the_safety_process_dies(live: Live) -> None:
    live.activate()
    live.run(0.5)
    live.leave("safety")
    live.run(COMMAND_AGE - 0.01)
    assert torque(live) > 1.0
    live.run(0.03)
    assert torque(live) == 0.0
    live.run(0.4)
    live.start_gate()
    live.run(0.1)
    assert live.state is GateState.ARMED
    assert live.ask("activate")[0]
    live.run(0.3)
    assert live.state is GateState.ACTIVE and torque(live) > 1.0


def test_a_twin_that_is_started_anew_freezes_nobody(live: Live) -> None:
    live.activate()
    live.run(0.5)
    live.leave("twin")
    live.run(0.2)
    assert live.state is GateState.STOP1 and live.reason in ("state_stale", "command_stale")
    live.start_twin(seed=1)  # its time begins at zero again
    live.run(0.1)
    assert live.up is not None and live.up.restarts == 1
    live.reset()
    assert live.ask("activate") == (True, "active")
    live.run(0.5)
    assert live.state is GateState.ACTIVE and stiff(live)


def test_another_writer_of_the_motors_command_is_named_and_stops_the_robot(live: Live) -> None:
    live.activate()
    intruder, _ = live.member("intruder")
    writer = intruder.writer("rt/lowcmd", hg.LOW_CMD.type_name, VENDOR)
    live.run(0.1)
    assert (live.state, live.reason) == (GateState.STOP1, "two_writers")
    assert live.gate is not None and writer.guid.hex() in live.gate.status.detail
    live.run(1.0)
    assert not live.ask("reset")[0]  # however long ago the stop was
    intruder.close()
    live.run(0.1)
    live.reset()


def test_states_that_are_refused_are_said_and_keep_nobody_waiting(
    live: Live, capsys: pytest.CaptureFixture[str]
) -> None:
    live.activate()
    live.leave("twin")
    stranger, node = live.member("stranger")
    writer = stranger.writer("rt/lowstate", hg.LOW_STATE.type_name, VENDOR)
    answer = node.client("/left/gripper/open", "std_srvs/srv/Trigger").call(Trigger_Request())
    for _ in range(50):
        writer.write(hg.LOW_STATE.blank())
        live.run(TICK)
        node.poll()
    assert answer.done
    assert live.up is not None and live.up.refused.count == 50
    said = capsys.readouterr().out
    assert said.count("states of the robot refused so far, the last one because: The checksum") == 1


def from_the_stack(live: Live) -> Callable[[bytes], None]:
    """Silence the stack, which keeps its lease, and return what has the gate hear a command of it."""
    assert live.gate is not None
    live.up = None
    inbox = live.gate._arrivals.sole["/safety/lowcmd_in"]
    assert inbox.newest is not None
    newest = inbox.newest
    return lambda payload: inbox._handle(replace(newest, payload=payload))


def test_one_command_with_a_wrong_checksum_is_dropped_and_a_run_of_them_stops_the_robot(live: Live) -> None:
    live.activate()
    zeros = np.zeros(NUM_JOINTS)
    payload = bytearray(encode_low_command(LowCommand(0.0, zeros, zeros, zeros, zeros, zeros), 0))
    payload[100] ^= 1
    send = from_the_stack(live)
    send(bytes(payload))
    live.run(0.01)
    assert live.state is GateState.ACTIVE and live.gate is not None
    send(bytes(payload))
    send(bytes(payload))
    live.run(0.002)
    assert (live.state, live.reason) == (GateState.STOP1, "command_damaged")
    assert "checksum" in live.gate.status.detail


@pytest.mark.parametrize("what", ["stop", "press"])
def test_an_operator_stops_the_robot_and_sets_it_free_again(live: Live, what: str) -> None:
    live.activate()
    assert live.ask(what)[0]
    live.run(0.02)
    assert live.state is GateState.STOP1
    assert live.reason == {"stop": "stop_requested", "press": "estop_pressed"}[what]
    if what == "press":
        live.run(1.0)
        success, said = live.ask("reset")
        assert not success and said.startswith("stop1 (estop_pressed); a reset needs the button released")
        assert live.ask("release")[0]
        live.run(0.02)
    live.reset()


def test_a_reset_right_after_a_stop_is_refused_with_what_it_needs(live: Live) -> None:
    live.activate()
    live.ask("stop")
    live.run(0.5)
    words = "a reset needs the button released, no fault, 1 s since the stop, and a robot at rest"
    assert live.ask("reset") == (False, f"stop1 (stop_requested); {words}")
    live.reset()


def test_a_reset_of_legs_that_stand_by_the_gate_succeeds_once_its_reason_is_gone(
    live: Live, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert live.gate is not None
    step, left = live.gate._gate.step, [Reason.COMMAND_STALE, None]

    def stands(inputs: GateInputs) -> GateResult:
        reason = left.pop(0) if inputs.request is OperatorRequest.RESET else left[0]
        return replace(step(inputs), state=GateState.STOP2, reason=reason, detail="")

    monkeypatch.setattr(live.gate._gate, "step", stands)
    success, said = live.ask("reset")
    assert not success and said.startswith("stop2 (command_stale); a reset needs")
    left.append(None)
    assert live.ask("reset") == (True, "stop2")


def test_a_command_is_as_old_as_the_state_it_answers(live: Live) -> None:
    live.activate()
    assert live.twin is not None
    answered = live.twin.executor.t - 0.02
    send = from_the_stack(live)
    zeros = np.zeros(NUM_JOINTS)
    kd = np.ones(NUM_JOINTS)
    payload = encode_low_command(LowCommand(0.0, zeros, zeros, zeros, zeros, kd), 0, answers=answered)
    for _ in range(60):  # it speaks, but it has gone blind
        send(payload)
        live.run(TICK)
    assert (live.state, live.reason) == (GateState.STOP1, "command_stale")


def test_a_client_that_does_not_say_what_it_answers_is_refused(live: Live) -> None:
    live.activate()
    live.leave("up")
    commander, _ = live.member("commander")
    zeros = np.zeros(NUM_JOINTS)
    writer = commander.writer("rt/safety/lowcmd_in", hg.LOW_CMD.type_name, VENDOR)
    writer.write(encode_low_command(LowCommand(0.0, zeros, zeros, zeros, zeros, zeros), 0))
    live.run(TICK)
    assert (live.state, live.reason) == (GateState.STOP1, "command_unstamped")
