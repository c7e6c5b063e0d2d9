from __future__ import annotations

import pytest

from golem.interfaces.unitree_api import GET_VERSION, LOCO_APIS, NOT_IMPLEMENTED, OK, decode, encode
from golem.middleware.wire.api import ApiRequest, Response
from golem.robots.unitree import loco_service
from golem.robots.unitree.loco_service import CHECK_MODE, RELEASE_MODE, SELECT_MODE, LocoService, MotionSwitcher

API = LOCO_APIS["h1"]


def call(service: MotionSwitcher | LocoService, api_id: int, parameter: str = "{}") -> Response:
    return service.answer(ApiRequest(7, api_id, parameter), 0.0)


def name(switcher: MotionSwitcher) -> object:
    answer = call(switcher, CHECK_MODE)
    assert answer.code == OK
    return decode(answer.data)["name"]


def test_a_client_that_wants_the_motors_releases_until_nobody_has_them() -> None:
    switcher = MotionSwitcher()
    calls = 0
    while name(switcher):  # the loop of the vendor's low-level examples
        assert call(switcher, RELEASE_MODE).code == OK
        calls += 1
    assert calls == 1
    assert call(switcher, RELEASE_MODE).code == OK


def test_a_mode_can_be_selected_again() -> None:
    switcher = MotionSwitcher()
    call(switcher, RELEASE_MODE)
    assert call(switcher, SELECT_MODE, encode({"name": "ai"})).code == OK
    assert name(switcher) == "ai"


@pytest.mark.parametrize(
    ("parameter", "code"),
    [
        ('{"name": "normal"}', loco_service.UNKNOWN_MODE),
        ("{}", loco_service.UNKNOWN_MODE),
        pytest.param(encode({"name": "x" * 1_000_000}), loco_service.UNKNOWN_MODE, id="a megabyte"),
        ("junk", loco_service.BAD_PARAMETER),
        ("[]", loco_service.BAD_PARAMETER),
    ],
)
def test_a_mode_there_is_not_is_refused_and_changes_nothing(parameter: str, code: int) -> None:
    switcher = MotionSwitcher()
    answer = call(switcher, SELECT_MODE, parameter)
    assert answer.code == code and 0 < len(answer.data) < 200
    assert name(switcher) == "ai"


def test_other_functions_are_answered() -> None:
    switcher = MotionSwitcher()
    assert call(switcher, GET_VERSION).data == "1.0.0.1"
    assert call(switcher, 1004).code == NOT_IMPLEMENTED


def test_the_loco_service_stops_with_its_mode_and_begins_anew() -> None:
    loco = LocoService(API)
    switcher = MotionSwitcher(loco)
    for state in (API.damp, API.stand_up):
        assert call(loco, API.set_fsm_id, encode({"data": state})).code == OK
    call(switcher, RELEASE_MODE)
    assert loco.state == API.zero_torque
    answer = call(loco, API.set_fsm_id, encode({"data": API.damp}))
    assert (answer.code, answer.data) == (API.not_available, "the motion mode is released")
    assert call(loco, GET_VERSION).code == OK
    call(switcher, SELECT_MODE, encode({"name": "ai"}))
    assert call(loco, API.set_fsm_id, encode({"data": API.damp})).code == OK


def test_selecting_the_present_mode_changes_nothing() -> None:
    loco = LocoService(API)
    switcher = MotionSwitcher(loco)
    call(loco, API.set_fsm_id, encode({"data": API.damp}))
    call(switcher, SELECT_MODE, encode({"name": "ai"}))
    assert loco.state == API.damp
