"""What a safety gate does is counted for whoever asks, and for nobody else."""

from __future__ import annotations

from golem.hardware.safety.base import SafetyLimits
from golem.interfaces.payloads import GateState, Reason
from golem.middleware.bus import Bus
from golem.runtime.safety_nodes import GateTally, SafetyNode, current_tally, tallied


def test_time_and_stops_are_counted_without_those_that_were_asked_for() -> None:
    tally = GateTally()
    tally.add(GateState.ARMED, GateState.ACTIVE, None)
    tally.add(GateState.ACTIVE, GateState.ACTIVE, None)
    tally.add(GateState.ACTIVE, GateState.STOP2, Reason.COMMAND_STALE)
    tally.add(GateState.STOP2, GateState.STOP1, Reason.COMMAND_STALE)
    tally.add(GateState.ACTIVE, GateState.STOP1, Reason.REQUESTED)
    tally.add(GateState.ACTIVE, GateState.STOP1, Reason.ESTOP_PRESSED)
    assert tally.active == 0.004 and tally.stops == {"command_stale": 1}


def test_a_gate_counts_for_who_asked_when_it_was_made() -> None:
    assert current_tally() is None
    with tallied() as outer:
        with tallied() as inner:
            node = SafetyNode(Bus(), SafetyLimits.from_profile())
            assert current_tally() is inner
        assert current_tally() is outer
        node.step(0.0)
    assert current_tally() is None
    assert (inner.active, inner.stops) == (0.0, {})
