"""The vendor's client against the real service logic, over a link that can be slow, dead or wrong."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from golem.capabilities.legs.base import STANDING, LocomotionCommand, LowerBody
from golem.capabilities.legs.vendor import SETTLE, Vendor, VendorConfig, VendorFault
from golem.errors import ConfigError
from golem.interfaces.payloads import LegCommand
from golem.interfaces.unitree_api import LOCO_APIS
from golem.middleware.wire.api import ApiRequest, Response
from golem.robots.unitree.loco_service import LocoService
from golem.types import LEGS, NUM_JOINTS, BaseEstimate, Imu, LowState, Twist

API = LOCO_APIS["h1"]
BASE = BaseEstimate(0.0, np.eye(4))
DT = 0.002
ON_BOARD = LegCommand(np.full(12, 0.1), np.full(12, 100.0), np.full(12, 2.0), np.zeros(12))


def state() -> LowState:
    zero = np.zeros(NUM_JOINTS)
    imu = Imu(np.array([1.0, 0, 0, 0]), np.zeros(3), np.array([0, 0, 9.81]))
    return LowState(0.0, np.full(NUM_JOINTS, 0.3), zero, zero, imu)


class Link:
    """A loco service behind a link on which calls and answers take `delay` ticks; `dead` loses them."""

    def __init__(self, delay: int = 2) -> None:
        self.service = LocoService(API)
        self.delay, self.dead, self.shift = delay, False, 0
        self.asked: list[ApiRequest] = []
        self.tick = 0
        self.command: LegCommand | None = None
        self._queue: deque[tuple[int, Response]] = deque()

    def send(self, service: str, request: ApiRequest) -> None:
        self.asked.append(request)
        if service == API.service and not self.dead:
            self.service.standing = self.service.state == API.stand_up
            answer = self.service.answer(request, self.tick * DT)
            self._queue.append((self.tick + self.delay, replace(answer, id=answer.id + self.shift)))

    def receive(self, service: str) -> Response | None:
        if self._queue and self._queue[0][0] <= self.tick:
            return self._queue.popleft()[1]
        return None

    def legs(self) -> LegCommand | None:
        return self.command


class Session:
    """A client at the end of a link."""

    def __init__(self, link: Link, config: VendorConfig | None = None) -> None:
        self.link = link
        self.legs = Vendor(config or VendorConfig(stand_up=0.2), link)
        self.legs.reset(state())

    def run(self, seconds: float, twist: Twist | None = None) -> LegCommand:
        motion = STANDING if twist is None else LocomotionCommand(twist, np.zeros(2), False, True)
        command = None
        for _ in range(round(seconds / DT)):
            command = self.legs.step(state(), BASE, motion, DT)
            self.link.tick += 1
        assert command is not None
        return command

    @property
    def now(self) -> Twist:
        return self.link.service.twist(self.link.tick * DT)


def calls(link: Link) -> list[tuple[int, str]]:
    return [(request.api_id, request.parameter) for request in link.asked]


def test_brings_the_robot_up_in_the_order_of_the_sdk() -> None:
    session = Session(Link())
    assert isinstance(session.legs, LowerBody)
    session.run(0.5)
    assert calls(session.link)[:5] == [
        (API.get_fsm_id, ""),
        (API.set_fsm_id, '{"data": 1}'),
        (API.set_fsm_id, '{"data": 2}'),
        (API.set_fsm_id, '{"data": 204}'),
        (API.set_velocity, '{"velocity": [0.0, 0.0, 0.0], "duration": 0.5}'),
    ]
    assert session.legs.started
    assert session.link.service.state == API.start
    assert len({request.id for request in session.link.asked}) == len(session.link.asked)


def test_legs_are_damped_until_the_robot_moves_them_and_then_its_own() -> None:
    session = Session(Link())
    command = session.run(DT)
    np.testing.assert_array_equal(command.kp, 0.0)
    assert (command.kd > 0).all()
    np.testing.assert_array_equal(command.q, state().q[LEGS])
    session.link.command = ON_BOARD
    assert session.run(DT) is ON_BOARD


def test_twists_are_passed_on_refreshed_and_run_out_when_the_client_dies() -> None:
    session = Session(Link())
    session.run(0.5)
    session.run(0.05, Twist(0.3, -0.1, 0.2))
    assert session.now == Twist(0.3, -0.1, 0.2)
    session.run(2.0, Twist(0.3, -0.1, 0.2))
    assert session.now == Twist(0.3, -0.1, 0.2)
    session.link.tick += round(0.5 / DT)
    assert session.now == Twist()


def test_a_twist_that_is_corrected_at_every_tick_is_sent_at_the_pace_of_its_refreshing() -> None:
    session = Session(Link())
    session.run(0.5)
    session.link.asked.clear()
    for k in range(500):
        session.run(DT, Twist(0.3 + 1e-3 * (k % 7)))
    seconds = 500 * DT
    assert seconds / 0.1 - 2 <= len(session.link.asked) <= seconds / 0.1 + 2
    session.run(0.02, Twist())  # a stop does not wait
    assert session.now == Twist()


def test_one_call_at_a_time_however_slow_the_answers() -> None:
    link = Link(delay=100)
    session = Session(link)
    session.run(1.2)
    link.asked.clear()
    session.run(1.0, Twist(0.1))
    assert len(link.asked) <= 5
    assert session.now == Twist(0.1)


def test_a_robot_that_walks_already_is_not_dropped() -> None:
    link = Link()
    link.service.state = API.start
    session = Session(link)
    session.run(0.3)
    assert {request.api_id for request in link.asked} == {API.get_fsm_id, API.set_velocity}
    assert session.legs.started


def test_a_service_that_is_not_there_is_a_fault_and_stays_one_until_reset() -> None:
    link = Link()
    link.dead = True
    session = Session(link)
    with pytest.raises(VendorFault, match=r"'loco' service did not answer get_fsm_id\(\) within 1 s"):
        session.run(1.3)
    assert 1.0 <= link.tick * DT <= 1.0 + SETTLE + 0.05
    with pytest.raises(VendorFault, match="did not answer"):
        session.run(DT)
    link.dead = False
    session.legs.reset(state())
    session.run(0.5)
    assert session.legs.started


def test_the_first_question_is_asked_again_and_nothing_else_is() -> None:
    session = Session(Link())
    session.link.dead = True
    session.run(SETTLE + 0.3)
    session.link.dead = False
    session.run(0.9)
    assert session.legs.started
    state, again, *rest = calls(session.link)
    assert state == again == (API.get_fsm_id, "")
    assert rest[:3] == [(API.set_fsm_id, f'{{"data": {s}}}') for s in (1, 2, 204)]
    session.link.dead = True
    asked = len(session.link.asked)
    with pytest.raises(VendorFault, match="did not answer"):
        session.run(2.0)
    assert len(session.link.asked) <= asked + 1


def test_a_service_that_dies_while_the_robot_walks_is_noticed() -> None:
    session = Session(Link())
    session.run(0.5, Twist(0.2))
    session.link.dead = True
    with pytest.raises(VendorFault, match=r"did not answer set_velocity\(\{\"velocity\": \[0.2, 0.0, 0.0\]"):
        session.run(1.3, Twist(0.2))
    assert not session.legs.started


def test_a_refusal_is_a_fault_with_its_code_and_reason() -> None:
    session = Session(Link())
    session.run(0.5)
    session.link.service.fail("the knee is gone")
    with pytest.raises(VendorFault, match=r"refused set_velocity.*code 8301, the knee is gone"):
        session.run(0.3)


def test_a_refusal_without_a_reason_says_what_the_code_means() -> None:
    link = Link()
    link.service.failure = ""
    session = Session(link, VendorConfig(stand_up=0.01))
    session.run(0.11)
    link.service.state = API.zero_torque  # somebody else has taken the robot
    with pytest.raises(VendorFault, match=r"set_fsm_id.*code 8302, no such state"):
        session.run(0.2)


def test_answers_to_other_calls_are_none() -> None:
    link = Link()
    link.shift = 1
    with pytest.raises(VendorFault, match="did not answer"):
        Session(link).run(1.3)


def test_nothing_is_sent_while_every_tick_begins_with_a_reset() -> None:
    link = Link()
    session = Session(link)
    for _ in range(200):
        session.legs.reset(state())
        session.run(DT)
    assert link.asked == []


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_twist_that_is_no_number_is_not_sent(bad: float) -> None:
    session = Session(Link())
    session.run(0.5)
    with pytest.raises(VendorFault, match=r"twist .* is not finite"):
        session.run(0.2, Twist(bad, 0.0, 0.0))
    assert all("NaN" not in request.parameter for request in session.link.asked)


@pytest.mark.parametrize(
    ("config", "words"),
    [
        (VendorConfig(robot="h3"), ["'h3'", "h1"]),
        (VendorConfig(timeout=0.0), ["timeout", "positive"]),
        (VendorConfig(stand_up=float("inf")), ["stand_up", "positive"]),
        (VendorConfig(refresh=0.6), ["refresh (0.6 s)", "duration (0.5 s)"]),
    ],
)
def test_wrong_options_are_named(config: VendorConfig, words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        Vendor(config, Link())
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_a_client_with_nobody_to_speak_to_is_refused() -> None:
    with pytest.raises(ConfigError, match="only a stack that runs on a twin connects"):
        Vendor()
