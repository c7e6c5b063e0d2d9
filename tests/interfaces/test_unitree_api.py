from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.interfaces.unitree_api import LOCO_APIS, TIMEOUT, decode, decode_int, decode_velocity, encode
from golem.middleware.wire.api import request_topic, response_topic


def test_topics_are_the_robots_without_the_domain_prefix() -> None:
    assert (request_topic("loco"), response_topic("loco")) == ("api/loco/request", "api/loco/response")


@pytest.mark.parametrize("name", LOCO_APIS)
def test_numbers_of_a_service_are_told_apart(name: str) -> None:
    api = LOCO_APIS[name]
    assert len({api.get_fsm_id, api.set_fsm_id, api.set_velocity}) == 3
    assert len({api.zero_torque, api.damp, api.stand_up, api.start}) == 4
    assert api.function(api.set_velocity) == "set_velocity"
    assert api.function(9) == "function 9"
    assert api.meaning(api.invalid_fsm_id) != api.meaning(api.not_available) != api.meaning(12345)
    assert api.meaning(TIMEOUT) == "no answer in time"


def test_payloads_are_what_the_sdk_sends() -> None:
    assert json.loads(encode({"data": 204})) == {"data": 204}
    assert decode_int('{"data":204}') == 204
    assert decode_velocity('{"velocity": [0.5, 0, -0.25], "duration": 1.0}') == ((0.5, 0.0, -0.25), 1.0)
    assert decode("") == {}


@pytest.mark.parametrize("payload", ["", "[]", "3", "{", '{"data": 1.5}', '{"data": true}', '{"data": "1"}'])
def test_a_payload_without_an_integer_is_refused(payload: str) -> None:
    with pytest.raises(ValueError):
        decode_int(payload)


@pytest.mark.parametrize(
    "payload",
    [
        "",
        '{"velocity": [0, 0, 0]}',
        '{"velocity": [0, 0], "duration": 1}',
        '{"velocity": 0.5, "duration": 1}',
        '{"velocity": [0, 0, "fast"], "duration": 1}',
        '{"velocity": [NaN, 0, 0], "duration": 1}',
        '{"velocity": [1e999, 0, 0], "duration": 1}',
        '{"velocity": [0, 0, 0], "duration": -1}',
        '{"velocity": [0, 0, 0], "duration": Infinity}',
    ],
)
def test_a_velocity_that_is_none_is_refused(payload: str) -> None:
    with pytest.raises(ValueError):
        decode_velocity(payload)


def test_json_cannot_say_nan() -> None:
    with pytest.raises(ValueError):
        encode({"velocity": [float("nan"), 0.0, 0.0]})


@given(st.text(max_size=40))
def test_any_text_is_decoded_or_a_value_error(text: str) -> None:
    for read in (decode, decode_int, decode_velocity):
        try:
            read(text)
        except ValueError:
            pass


@pytest.mark.parametrize("payload", ["[" * 100_000, '{"data":' * 100_000])
def test_a_payload_of_any_depth_is_a_value_error(payload: str) -> None:
    with pytest.raises(ValueError):
        decode_int(payload)


def test_a_number_no_float_holds_is_refused() -> None:
    with pytest.raises(ValueError):
        decode_velocity('{"velocity": [1%s, 0, 0], "duration": 1}' % ("0" * 400))
