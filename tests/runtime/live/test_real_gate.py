"""What the gate of the real robot wants before it lets a command through, and what a pause of its own means."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from tests.middleware.wire.rpc import reach
from tests.runtime.live.conftest import Live

from golem.errors import ConfigError
from golem.interfaces.payloads import GateState
from golem.interfaces.unitree_api import encode
from golem.middleware.dds.base import Qos
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.local import LocalReader
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.ros.node import RosNode
from golem.middleware.wire import convert as wire
from golem.middleware.wire import hg
from golem.middleware.wire.api import ApiRequest, RpcServer
from golem.robots.unitree import loco_service
from golem.runtime.live import motion_switcher_client, operator
from golem.runtime.live.safety_arrivals import Arrivals
from golem.runtime.live.safety_main import SafetyConfig, run_safety
from golem.runtime.live.safety_process import LOOK, WARY, SafetyProcess
from golem.types import TICK


def same(reader: LocalReader, gate: SafetyProcess | None) -> bool:
    """Return whether the gate is in the process of `reader`."""
    return gate is not None and reader.guid[:12] == gate._out.guid[:12]


def let_go(live: Live) -> None:
    """Replace the gate by one for a real robot whose own controller has let go of the motors."""
    live.leave("safety")
    live.start_gate(real=True)
    reach(live.member("hand")[0], loco_service.SERVICE).send(ApiRequest(1, loco_service.RELEASE_MODE))
    live.run(1.5)


def test_a_real_robots_motors_are_not_touched_before_its_own_controller_lets_go_of_them(live: Live) -> None:
    live.leave("safety")
    live.start_gate(real=True)
    assert live.gate is not None
    participant, node = live.member("listener")
    motors = participant.reader("rt/lowcmd", hg.LOW_CMD.type_name, Qos(reliable=False, depth=1000))
    live.run(1.2)
    assert (live.state, live.reason) == (GateState.INIT, "motors_held") and not motors.take(1000)
    assert "'ai'" in live.gate.status.detail and "golem safety take --hanging" in live.gate.status.detail
    assert not live.ask("activate")[0]

    switcher = reach(participant, loco_service.SERVICE)
    switcher.send(ApiRequest(1, loco_service.RELEASE_MODE))
    live.run(1.0)
    assert live.state is GateState.ARMED and motors.take(1000)
    live.activate()

    switcher.send(ApiRequest(2, loco_service.SELECT_MODE, encode({"name": loco_service.MODE})))
    live.run(1.0)
    assert (live.state, live.reason) == (GateState.STOP1, "motors_held")
    *stiff, last = [wire.decode_low_command(sample.payload, 0.0) for sample in motors.take(1000)]
    assert stiff[-1].kp.any() and not last.kp.any() and last.kd.all()
    live.run(0.1)
    assert not motors.take(1000)  # not even to damp them
    live.leave_quietly(node)


def test_whoever_has_the_motors_hides_nothing_else_that_is_missing(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    def until(node: RosNode, condition: Callable[[], bool], timeout: float) -> bool:
        live.run(1.0, lambda: bool(node.poll()) or condition())
        return condition()

    monkeypatch.setattr(operator, "until", until)
    live.leave("safety")
    live.start_gate(real=True)
    live.run(1.2)
    assert live.reason == "motors_held"
    assert live.ask("press")[0]
    live.run(0.1)
    assert (live.state, live.reason) == (GateState.INIT, "estop_pressed")  # what the bring-up waits for
    with pytest.raises(ConfigError, match="would not damp the motors: estop_pressed"):
        operator._take(*live.member("operator"), operator.TakeConfig(hanging=True))
    assert live.ask("release")[0]
    live.run(0.1)
    assert live.reason == "motors_held"


def test_a_button_pressed_before_the_activation_leaves_the_motors_damped(live: Live) -> None:
    let_go(live)
    participant, node = live.member("listener")
    motors = participant.reader("rt/lowcmd", hg.LOW_CMD.type_name, Qos(reliable=False, depth=1000))
    assert live.state is GateState.ARMED
    assert live.ask("press")[0]
    live.run(0.3)
    motors.take(1000)
    live.run(0.3)
    assert (live.state, live.reason) == (GateState.INIT, "estop_pressed")
    told = [wire.decode_low_command(sample.payload, 0.0) for sample in motors.take(1000)]
    assert len(told) > 100 and not any(command.kp.any() for command in told) and all(c.kd.all() for c in told)
    live.leave_quietly(node)


def test_a_motion_switcher_that_falls_silent_keeps_the_gate_shut_but_stops_nobody(
    live: Live, monkeypatch: pytest.MonkeyPatch
) -> None:
    live.leave("safety")
    live.start_gate(real=True)
    participant, _ = live.member("operator")
    reach(participant, loco_service.SERVICE).send(ApiRequest(1, loco_service.RELEASE_MODE))
    live.run(1.0)
    live.activate()
    monkeypatch.setattr(RpcServer, "reply", lambda server, response: None)
    live.run(2.5 * motion_switcher_client.SILENCE)
    assert live.state is GateState.ACTIVE
    motors = participant.reader("rt/lowcmd", hg.LOW_CMD.type_name, Qos(reliable=False, depth=1000))
    assert live.ask("stop")[0]
    live.run(1.0)
    told = [wire.decode_low_command(sample.payload, 0.0) for sample in motors.take(1000)]
    assert len(told) > 450  # it is damped all the same
    assert not any(command.kp.any() for command in told[1:]) and told[-1].kd.any()
    assert not live.ask("reset")[0]
    live.leave("safety")
    live.start_gate(real=True)
    live.run(1.2)
    assert (live.state, live.reason) == (GateState.INIT, "motors_held")
    assert live.gate is not None and "does not say" in live.gate.status.detail


def test_a_controller_whose_name_cannot_be_printed_has_the_motors_all_the_same(
    live: Live, monkeypatch: pytest.MonkeyPatch
) -> None:
    live.leave("safety")
    live.start_gate(real=True)
    assert live.gate is not None
    live.run(1.2)
    reply = RpcServer.reply
    nonsense = '{"form": "0", "name": "\\ud800"}'
    monkeypatch.setattr(RpcServer, "reply", lambda server, said: reply(server, replace(said, data=nonsense)))
    live.run(1.0)
    assert live.gate.status.detail.startswith(r"the robot's own controller '\ud800' has the motors")


def test_a_gate_that_was_held_up_damps_a_robot_that_nobody_watched(live: Live) -> None:
    live.activate()
    _, node = live.member("operator")
    client = node.client("/safety/activate", "std_srvs/srv/Trigger")
    gate, live.gate = live.gate, None
    asked = client.call(Trigger_Request())
    live.run(0.5)
    live.gate = gate
    live.run(TICK)
    assert (live.state, live.reason) == (GateState.STOP1, "gate_stalled")
    node.poll()
    assert not asked.result().success and "held up" in asked.result().message
    live.run(0.5)
    assert "held up" in live.ask("reset")[1]  # who asked may have done so during the pause
    assert live.ask("stop")[0]
    live.run(WARY)
    assert live.ask("reset") == (True, "armed")
    live.activate()


def test_a_request_that_comes_as_the_process_ends_keeps_nobody_moving(live: Live) -> None:
    live.activate()
    _, node = live.member("operator")
    asked = node.client("/safety/reset", "std_srvs/srv/Trigger").call(Trigger_Request())
    assert live.gate is not None
    assert not live.gate.stop() and live.state is GateState.STOP1
    node.poll()
    assert asked.result().message == "The safety process ends."


@pytest.mark.parametrize("active", [False, True])
def test_motors_that_do_not_hear_are_not_commanded(active: bool, live: Live) -> None:
    let_go(live)
    assert live.state is GateState.ARMED
    if active:
        live.activate()
    # The gate has a reader of its own, by which it finds other writers.
    theirs = [r for r in live.domain._readers if r.topic == "rt/lowcmd" and not same(r, live.gate)]
    assert len(theirs) == 1
    theirs[0].close()
    live.run(LOOK + TICK)
    assert (live.state, live.reason) == (GateState.STOP1 if active else GateState.INIT, "motors_unheard")


def test_a_robot_that_says_nothing_is_what_is_missing(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Arrivals, "_state", lambda self, sample: None)
    let_go(live)
    assert (live.state, live.reason) == (GateState.INIT, "state_never_seen")


def test_a_robot_whose_time_has_another_unit_is_not_armed(live: Live) -> None:
    let_go(live)
    assert live.state is GateState.ARMED
    end = live.clock + 3.0
    while live.clock < end:
        live.run(TICK)
        live.clock += TICK  # half of its ticks are missing
    assert live.gate is not None
    assert (live.state, live.reason) == (GateState.INIT, "state_clock")
    assert "runs at 0.50 of ours" in live.gate.status.detail


def test_the_real_robot_is_guarded_with_the_smaller_torques() -> None:
    with pytest.raises(ConfigError, match="--limits urdf, not 'paper'"):
        run_safety(SafetyConfig("paper", dds=DdsConfig(domain=0, interface="eth7", robot=True)))
