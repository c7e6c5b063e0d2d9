"""The node of the safety gate hands the base estimate over."""

from __future__ import annotations

import numpy as np

from golem.hardware.safety.base import OperatorRequest, SafetyLimits
from golem.interfaces import topics
from golem.interfaces.payloads import EstopMessage, GateState, Reason
from golem.middleware.bus import Bus
from golem.runtime.safety_nodes import SafetyNode
from golem.types import NUM_JOINTS, BaseEstimate, Imu, LowCommand, LowState

DT = 0.002


def test_an_estimate_that_stays_stale_stops_the_motors() -> None:
    bus = Bus()
    node = SafetyNode(bus, SafetyLimits.from_profile().still())
    node.request = OperatorRequest.ACTIVATE
    zero, held = np.zeros(NUM_JOINTS), np.full(NUM_JOINTS, 3.0)
    imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))
    results = []
    for i in range(500):
        t = i * DT
        bus.publish(topics.LOW_STATE, LowState(t, zero, zero, zero, imu), t)
        bus.publish(topics.LOW_CMD_REQUEST, LowCommand(t, zero, zero, zero, zero, held), t)
        bus.publish(topics.ESTOP, EstopMessage(t, i % 256, False), t)
        bus.publish(topics.BASE, BaseEstimate(t, np.eye(4), stale=i >= 100), t)
        bus.deliver(t)
        node.step(t)
        result = bus.latest(topics.SAFETY)
        assert result is not None
        results.append(result)
    assert all(r.state is GateState.ACTIVE for r in results[5:200])
    assert (results[-1].state, results[-1].reason) == (GateState.STOP1, Reason.BASE_STALE)
