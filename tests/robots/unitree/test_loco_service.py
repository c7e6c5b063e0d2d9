from __future__ import annotations

from golem.interfaces.unitree_api import BAD_PARAMETER, GET_VERSION, LOCO_APIS, NOT_IMPLEMENTED, OK, decode_int, encode
from golem.middleware.wire.api import ApiRequest, Response
from golem.robots.unitree.loco_service import LocoService
from golem.types import Twist

API = LOCO_APIS["h1"]


def call(service: LocoService, api_id: int, t: float = 0.0, **values: object) -> Response:
    return service.answer(ApiRequest(7, api_id, encode(values) if values else ""), t)


def enter(service: LocoService, state: int) -> int:
    return call(service, API.set_fsm_id, data=state).code


def started() -> LocoService:
    service = LocoService(API)
    assert [enter(service, API.damp), enter(service, API.stand_up)] == [OK, OK]
    service.standing = True
    assert enter(service, API.start) == OK
    return service


def test_an_answer_repeats_the_identity_of_its_call() -> None:
    answer = call(LocoService(API), GET_VERSION)
    assert (answer.id, answer.api_id, answer.code, answer.data) == (7, GET_VERSION, OK, "2.0.0.0")


def test_the_state_is_told() -> None:
    service = LocoService(API)
    assert decode_int(call(service, API.get_fsm_id).data) == API.zero_torque
    enter(service, API.damp)
    assert decode_int(call(service, API.get_fsm_id).data) == API.damp


def test_the_robot_stands_up_before_it_starts() -> None:
    service = LocoService(API)
    assert enter(service, API.start) == API.invalid_fsm_id
    assert enter(service, API.stand_up) == API.invalid_fsm_id
    assert enter(service, API.damp) == OK
    assert enter(service, API.start) == API.invalid_fsm_id
    assert enter(service, API.stand_up) == OK
    assert enter(service, API.start) == API.invalid_fsm_id  # not up yet
    service.standing = True
    assert enter(service, API.start) == OK
    assert enter(service, 77) == API.invalid_fsm_id
    assert service.state == API.start


def test_damp_and_zero_torque_are_reached_from_everywhere() -> None:
    for state in (API.damp, API.zero_torque):
        service = started()
        assert enter(service, state) == OK
        assert service.state == state
        assert not service.standing


def test_a_velocity_runs_out() -> None:
    service = started()
    assert call(service, API.set_velocity, 1.0, velocity=[0.3, 0.1, -0.2], duration=0.5).code == OK
    assert service.twist(1.4) == Twist(0.3, 0.1, -0.2)
    assert service.twist(1.5) == Twist()


def test_a_velocity_does_not_outlive_the_start_state() -> None:
    service = started()
    call(service, API.set_velocity, 1.0, velocity=[0.3, 0, 0], duration=100.0)
    enter(service, API.damp)
    assert service.twist(1.1) == Twist()


def test_calls_that_cannot_be_followed_are_refused() -> None:
    service = LocoService(API)
    assert call(service, API.set_velocity, velocity=[0, 0, 0], duration=1.0).code == API.not_available
    assert call(service, API.set_velocity, velocity=[0, 0], duration=1.0).code == BAD_PARAMETER
    assert service.answer(ApiRequest(1, API.set_fsm_id, "junk"), 0.0).code == BAD_PARAMETER
    assert call(service, 8205).code == NOT_IMPLEMENTED


def test_nonsense_of_any_length_gets_a_short_answer() -> None:
    long = "x" * 1_000_000
    for parameter in (long, encode({"data": long}), encode({"velocity": [long]}), f'"{long}"'):
        for api_id in (API.set_fsm_id, API.set_velocity):
            answer = LocoService(API).answer(ApiRequest(1, api_id, parameter), 0.0)
            assert answer.code == BAD_PARAMETER
            assert len(answer.data) < 200


def test_legs_that_failed_are_damped_and_do_not_start_again() -> None:
    service = started()
    service.fail("the knee is gone")
    assert service.state == API.damp
    answer = call(service, API.set_velocity, velocity=[0.1, 0, 0], duration=1.0)
    assert (answer.code, answer.data) == (API.not_available, "the knee is gone")
    assert enter(service, API.stand_up) == API.invalid_fsm_id
