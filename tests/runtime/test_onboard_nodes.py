"""The vendor's way of moving the legs, end to end: client, bus, on-board service, motor control, safety gate."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.legs.hold import STANCES, JointHold
from golem.interfaces import topics
from golem.interfaces.payloads import GateState, LegStatus
from golem.interfaces.unitree_api import LOCO_APIS, encode
from golem.middleware.bus import Bus
from golem.middleware.wire.api import ApiRequest, Response, request_topic, response_topic
from golem.runtime.contract_check import ContractCheck
from golem.runtime.lockstep import LockstepRunner, build
from golem.runtime.lower_body_node import CheckedLowerBody
from golem.runtime.onboard_nodes import ANSWER, BusOnboard, LocoServiceNode
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.stack import Choice, Stack, load_stack
from golem.types import LEGS, Twist

API = LOCO_APIS["h1"]
FAILING = """
from golem.capabilities.legs.hold import JointHold

class Failing(JointHold):
    def step(self, state, base, motion, dt):
        raise RuntimeError("the network is gone")
"""


@contextmanager
def hanging(**choices: Choice) -> Iterator[LockstepRunner]:
    """A tethered stack whose legs the vendor's controller moves."""
    running, robot = build(Stack({"lower_body": Choice("vendor"), **choices}, profile="ideal"), seed=0)
    try:
        yield running
    finally:
        robot.close()


class Drive:
    """Walks ahead."""

    name = "drive"

    async def run(self, context: Context, goal: object) -> SkillResult:
        """Send the twist as long as the skill runs."""
        while True:
            context.publish(topics.TWIST, Twist(0.3))
            await context.tick()


def legs(running: LockstepRunner) -> LegStatus:
    status = running.bus.latest(topics.LEG_STATUS)
    assert status is not None
    return status


@pytest.mark.parametrize("robot", LOCO_APIS)
def test_the_onboard_controller_moves_the_legs_by_the_calls_of_any_robot(robot: str) -> None:
    vendor = Choice("vendor", {"robot": robot})
    with hanging(lower_body=vendor, onboard=Choice("hold", {"stance": "straight", "speed": 2.0})) as running:
        running.executor.run(3.0)
        state = running.bus.latest(topics.LOW_STATE)
        safety = running.safety
        assert state is not None and safety is not None
        assert safety.state is GateState.ACTIVE
        assert legs(running).fault is None
        # Hanging free without gravity compensation, which vendor legs do not ask for, they sag a little.
        np.testing.assert_allclose(state.q[LEGS], np.tile(STANCES["straight"], 2), atol=0.1)


def test_an_onboard_controller_that_fails_leaves_the_legs_to_the_fallback(tmp_path: Path) -> None:
    path = tmp_path / "failing.py"
    path.write_text(FAILING)
    with hanging(onboard=Choice(f"{path}:Failing"), fallback=Choice("hold")) as running:
        running.executor.run(2.0)
        fault = legs(running).fault
        assert fault is not None
        assert "vendor" in fault and "refused set_velocity" in fault and "the network is gone" in fault
        assert legs(running).controller == "hold"


def test_calls_are_answered_later_on_the_bus() -> None:
    bus = Bus()
    node = LocoServiceNode(bus, API, CheckedLowerBody(JointHold(), ContractCheck("lower_body", "hold")))
    client = BusOnboard(bus)
    assert client.receive(API.service) is None and client.legs() is None
    client.send(API.service, ApiRequest(1, API.set_fsm_id, encode({"data": API.damp})))
    node.step(0.0)
    assert client.receive(API.service) is None
    bus.deliver(ANSWER)
    assert client.receive(API.service) == Response(1, API.set_fsm_id)
    assert client.receive(API.service) is None
    assert set(bus.topics()) == {request_topic(API.service), response_topic(API.service)}


@pytest.mark.slow
def test_a_robot_on_the_ground_is_brought_up_and_walks_by_remote_calls() -> None:
    stack = load_stack("stand", profile="bench").with_choice("lower_body", "vendor")
    running, robot = build(stack.with_options("robot", world="open"), seed=0)
    try:
        running.executor.run(5.0)
        assert not robot.on_gantry
        stood = robot.data.qpos[:3].copy()
        running.start(Drive(), None)
        running.executor.run(9.0)
        safety = running.safety
        assert safety is not None and safety.state is GateState.ACTIVE, safety
        assert legs(running).fault is None
        assert robot.data.qpos[2] > 0.9
        assert robot.data.qpos[0] - stood[0] > 0.6  # 0.3 m/s for 4 s, slewed at both ends
    finally:
        robot.close()
