"""What the transport finds wrong stops the robot by name, and keeps a gate from being armed while it lasts."""

from __future__ import annotations

import pytest
from tests.hardware.conftest import Bench

from golem.hardware.safety.base import OperatorRequest
from golem.interfaces.payloads import Fault, GateState, Reason


@pytest.mark.parametrize("reason", [Reason.WRITERS, Reason.STATE_DAMAGED, Reason.COMMAND_DAMAGED])
def test_one_fault_of_the_transport_stops_and_is_latched(bench: Bench, reason: Reason) -> None:
    bench.activate()
    result = bench.tick(transport=(Fault(reason, "by whom"),))
    bench.wait(1.0)
    assert (result.state, result.reason, result.detail) == (GateState.STOP1, reason, "by whom")
    assert bench.tick().reason is reason
    assert bench.tick(request=OperatorRequest.RESET, transport=(Fault(reason),)).state is GateState.STOP1
    assert bench.tick(request=OperatorRequest.NONE).state is GateState.STOP1
    assert bench.tick(request=OperatorRequest.RESET).state is GateState.ARMED


def test_no_gate_is_armed_beside_another_writer(bench: Bench) -> None:
    result = bench.tick(transport=(Fault(Reason.WRITERS, "process 7"),), request=OperatorRequest.ACTIVATE)
    assert (result.state, result.reason, result.detail) == (GateState.INIT, Reason.WRITERS, "process 7")
