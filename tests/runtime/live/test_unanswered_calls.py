"""A LocoClient that nobody answers is spoken of where the robot runs."""

from __future__ import annotations

from tests.middleware.wire.rpc import reach
from tests.runtime.live.conftest import Live

from golem.interfaces.unitree_api import LOCO_APIS
from golem.middleware.wire.api import ApiRequest
from golem.runtime.live.twin import Twin
from golem.runtime.lockstep import build_robot

API = LOCO_APIS["h1"]


def test_a_call_that_nobody_answers_is_told_once(live: Live) -> None:
    told: list[str] = []
    live.leave("twin")
    live.robot = build_robot(live.stack, 0)
    live.twin = Twin(live.stack, live.robot, *live.member("twin"), patience=0.0, tell=told.append)
    client = reach(live.member("sdk")[0], API.service)
    for number in range(2):
        client.send(ApiRequest(number, API.get_fsm_id))
        for _ in range(3):
            live.twin.executor.step()
    (line,) = told
    assert line == (
        "A LocoClient calls get_fsm_id of the service 'loco'. Nobody answers it: this robot has no legs on board. "
        "They come with this line in the stack file: lower_body: {use: vendor}."
    )
    assert client.take() == []
