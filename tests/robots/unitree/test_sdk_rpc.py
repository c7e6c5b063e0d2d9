"""Remote calls between the vendor's SDK and this package, over DDS; see `conftest.py` for what they need."""

from __future__ import annotations

import json
import time

import pytest
from tests.middleware.wire.rpc import call, reach, serve
from tests.robots.unitree.conftest import Started
from tests.robots.unitree.sdk_rpc import ECHO, FAIL

from golem.capabilities.legs.hold import JointHold
from golem.interfaces.unitree_api import LOCO_APIS, NOT_IMPLEMENTED, OK
from golem.middleware.bus import Bus
from golem.robots.unitree import loco_service
from golem.robots.unitree.loco_service import UNKNOWN_MODE, MotionSwitcher
from golem.runtime.contract_check import ContractCheck
from golem.runtime.executor import Executor
from golem.runtime.live.onboard_bridge import AnswersOut, CallsIn
from golem.runtime.lower_body_node import CheckedLowerBody
from golem.runtime.onboard_nodes import LocoServiceNode, ServiceNode
from golem.types import TICK

pytestmark = pytest.mark.slow
API = LOCO_APIS["h1"]
DEADLINE = 40.0


def test_the_vendors_clients_are_answered(sdk: Started, domain: int) -> None:
    from golem.middleware.dds.connect import connect
    from golem.middleware.dds.domain import DdsConfig

    participant, bus = connect(DdsConfig(domain)), Bus()
    try:
        loco = LocoServiceNode(bus, API, CheckedLowerBody(JointHold(), ContractCheck("lower_body", "hold")))
        switcher = ServiceNode(bus, loco_service.SERVICE, MotionSwitcher(loco.service).answer)
        servers = {name: serve(participant, name) for name in (API.service, loco_service.SERVICE)}
        calls = [CallsIn(bus, name, server) for name, server in servers.items()]
        answers = [AnswersOut(bus, name, server) for name, server in servers.items()]
        executor = Executor(bus, [*calls, loco, switcher, *answers])
        process = sdk("sdk_rpc.py", "client", str(domain))
        deadline = time.monotonic() + DEADLINE
        while process.poll() is None and time.monotonic() < deadline:
            executor.step()
            time.sleep(TICK)
    finally:
        participant.close()
    assert process.poll() == 0
    said = process.communicate()[0]
    assert json.loads(said.strip().splitlines()[-1]) == [
        [OK, "1.0.0.1"],
        [OK, {"form": "0", "name": "ai"}],
        [UNKNOWN_MODE, None],
        [OK, API.version],
        API.invalid_fsm_id,
        OK,
        OK,
        API.not_available,
        NOT_IMPLEMENTED,
        [OK, None],
        [OK, {"form": "0", "name": ""}],
        API.not_available,
        [OK, None],
        [OK, {"form": "0", "name": "ai"}],
    ]


def test_the_vendors_server_is_called(sdk: Started, domain: int) -> None:
    from golem.middleware.dds.connect import connect
    from golem.middleware.dds.domain import DdsConfig

    participant = connect(DdsConfig(domain))
    try:
        client = reach(participant, "test")
        assert not client.connected
        process = sdk("sdk_rpc.py", "server", str(domain))
        assert call(client, 1, timeout=DEADLINE, again=1.0).data == "1.2.3.4"
        for number in range(20):
            answer = call(client, ECHO, json.dumps({"data": number}))
            assert (answer.code, answer.data) == (OK, json.dumps({"data": number}))
        assert call(client, FAIL).code == 42
        assert call(client, 77777).code == NOT_IMPLEMENTED
        assert process.poll() is None
    finally:
        participant.close()
