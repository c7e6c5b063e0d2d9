from __future__ import annotations

import numpy as np
import pytest
from tests.middleware.wire.rpc import reach, serve

from golem.capabilities.legs.hold import JointHold
from golem.interfaces import public, topics
from golem.interfaces.payloads import LegCommand
from golem.interfaces.public import decode_legs, encode_legs
from golem.interfaces.unitree_api import LOCO_APIS, OK, decode_int, encode
from golem.middleware.bus import Bus
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.node import RosNode
from golem.middleware.wire import hg
from golem.middleware.wire.api import ApiRequest, Response
from golem.robots.unitree import loco_service
from golem.robots.unitree.loco_service import CHECK_MODE, MotionSwitcher
from golem.runtime.contract_check import ContractCheck
from golem.runtime.executor import Executor
from golem.runtime.live.bridge import StreamIn, StreamOut
from golem.runtime.live.onboard_bridge import AnswersIn, AnswersOut, CallsIn, CallsOut, Identities
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.lower_body_node import CheckedLowerBody
from golem.runtime.onboard_nodes import BusOnboard, LocoServiceNode, ServiceNode
from golem.types import Array

API = LOCO_APIS["h1"]


def robot(domain: LocalDomain) -> Executor:
    """The robot's side: both services, behind the domain."""
    bus, participant = Bus(), domain.participant()
    loco = LocoServiceNode(bus, API, CheckedLowerBody(JointHold(), ContractCheck("lower_body", "hold")))
    switcher = ServiceNode(bus, loco_service.SERVICE, MotionSwitcher(loco.service).answer)
    servers = {name: serve(participant, name) for name in (API.service, loco_service.SERVICE)}
    calls = [CallsIn(bus, name, server) for name, server in servers.items()]
    answers = [AnswersOut(bus, name, server) for name, server in servers.items()]
    return Executor(bus, [*calls, loco, switcher, *answers])


class Station:
    """One computer off board, with the leg controller's view of the robot."""

    def __init__(self, domain: LocalDomain) -> None:
        bus = Bus()
        client, identities = reach(domain.participant(), API.service), Identities()
        incoming = AnswersIn(bus, API.service, client, identities)
        outgoing = CallsOut(bus, API.service, client, identities)
        self.onboard = BusOnboard(bus)
        self.executor = Executor(bus, [incoming, outgoing])

    def ask(self, number: int, api_id: int, parameter: str = "") -> None:
        self.onboard.send(API.service, ApiRequest(number, api_id, parameter))


def run(*executors: Executor, ticks: int = 10) -> None:
    for _ in range(ticks):
        for executor in executors:
            executor.step()


def test_a_leg_controller_reaches_the_loco_service_of_another_process() -> None:
    domain = LocalDomain()
    twin, station = robot(domain), Station(domain)
    station.ask(1, API.set_fsm_id, encode({"data": API.damp}))
    run(station.executor, twin)
    assert station.onboard.receive(API.service) == Response(1, API.set_fsm_id)
    station.ask(2, API.get_fsm_id)
    run(station.executor, twin)
    answer = station.onboard.receive(API.service)
    assert answer is not None and decode_int(answer.data) == API.damp


def test_a_call_waits_for_its_service() -> None:
    domain = LocalDomain()
    station = Station(domain)
    station.ask(1, API.get_fsm_id)
    run(station.executor)
    twin = robot(domain)
    run(station.executor, twin)
    answer = station.onboard.receive(API.service)
    assert answer is not None and (answer.id, answer.code) == (1, OK)


def test_stations_that_count_alike_do_not_get_each_others_answers() -> None:
    domain = LocalDomain()
    twin, stations = robot(domain), [Station(domain), Station(domain)]
    stations[0].ask(1, API.get_fsm_id)
    stations[1].ask(1, API.set_fsm_id, encode({"data": 77}))
    run(twin, *(station.executor for station in stations))
    answers = [station.onboard.receive(API.service) for station in stations]
    assert [answer and answer.code for answer in answers] == [OK, API.invalid_fsm_id]
    run(twin, *(station.executor for station in stations))
    assert [station.onboard.receive(API.service) for station in stations] == [None, None]


def test_calls_that_come_together_are_all_answered_and_none_that_wants_no_answer() -> None:
    domain = LocalDomain()
    twin, client = robot(domain), reach(domain.participant(), loco_service.SERVICE)
    for number in range(20):
        client.send(ApiRequest(number, CHECK_MODE, noreply=number % 4 == 0))
    run(twin, ticks=30)
    assert [answer.id for answer in client.take()] == [n for n in range(20) if n % 4]


def legs(tau: Array | None) -> LegCommand:
    return LegCommand(np.arange(12) / 4.0, np.arange(12.0) * 10.0, np.arange(12) / 2.0, tau)


@pytest.mark.parametrize("tau", [None, np.arange(12) / 8.0])
def test_targets_of_the_legs_cross_over(tau: Array | None) -> None:
    domain, bus, there = LocalDomain(), Bus(), Bus()
    ours, theirs = domain.participant(), domain.participant()
    robot = RoleEndpoints("robot", ours, RosNode(ours, "robot"))
    stack = RoleEndpoints("stack", theirs, RosNode(theirs, "stack"))
    row = public.topic("/onboard/lowcmd")
    out, incoming = StreamOut(bus, robot, row), StreamIn(there, stack, row, lambda: 0.0, print)
    bus.publish(topics.ONBOARD_LEGS, legs(tau), 0.0)
    out.step(0.0)
    robot.publish(row.name, hg.LOW_CMD.blank())
    stack.step(0.0)
    got = BusOnboard(there).legs()
    assert got is not None
    for name in ("q", "kp", "kd", "tau"):
        np.testing.assert_array_equal(getattr(got, name), getattr(legs(tau), name))
    assert incoming.refused.count == 1 and "checksum" in incoming.refused.why


def test_the_other_motors_get_nothing() -> None:
    payload = encode_legs(legs(None))
    motor = hg.LOW_CMD.read(payload)["motor"]
    assert not any(motor[name][12:].any() for name in ("q", "dq", "tau", "kp", "kd"))
    assert decode_legs(payload).tau is None
