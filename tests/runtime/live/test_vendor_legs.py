"""The vendor's way of moving the legs, across processes: calls go over the domain, and the legs' targets come back."""

from __future__ import annotations

import numpy as np
import pytest
from tests.middleware.wire.rpc import reach
from tests.runtime.live.conftest import Live

from golem.capabilities.legs.hold import STANCES
from golem.interfaces import topics
from golem.interfaces.payloads import GateState, LegStatus
from golem.middleware.wire.api import ApiRequest
from golem.robots.unitree.loco_service import RELEASE_MODE, SERVICE
from golem.stack import Choice
from golem.types import LEGS


def legs(live: Live) -> LegStatus:
    assert live.up is not None and live.up.side is not None
    status = live.up.side.bus.latest(topics.LEG_STATUS)
    assert status is not None
    return status


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["h1", "g1"])
def test_the_onboard_controller_moves_the_legs_until_its_mode_is_released(live: Live, robot: str) -> None:
    for node in ("up", "safety", "twin"):
        live.leave(node)
    onboard = Choice("hold", {"stance": "straight", "speed": 2.0})
    vendor = Choice("vendor", {"robot": robot})
    live.stack = live.stack.with_choice("lower_body", vendor).with_choice("onboard", onboard)
    live.start_twin()
    live.start_gate()
    live.start_up()
    live.activate()
    live.run(3.0)
    assert live.state is GateState.ACTIVE
    assert legs(live).fault is None
    np.testing.assert_allclose(live.robot.joints()[0][LEGS], np.tile(STANCES["straight"], 2), atol=0.1)

    stranger, node = live.member("stranger")
    reach(stranger, SERVICE).send(ApiRequest(1, RELEASE_MODE))
    live.run(1.0)
    live.leave_quietly(node)
    fault = legs(live).fault
    assert fault is not None and "the motion mode is released" in fault
