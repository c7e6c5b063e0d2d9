"""The driver of a MAGPIE hand on a simulated bus, with the hand's controller before it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from tests.hardware.drivers.simulated_ax12 import SimulatedAx12, SimulatedBus

from golem.errors import ConfigError
from golem.hardware.drivers.magpie_servos import FingerConfig, HandFault, MagpieServoConfig, MagpieServos
from golem.hardware.hands.magpie import MagpieConfig, MagpieHand, clamp_force
from golem.interfaces.payloads import GripState
from golem.robots.model import magpie_model
from golem.types import HandCommand, HandState

DT = 0.002
PERIOD = 0.010
OPEN = (89.0, 300.0)
"""Angles of the open servos [degrees]."""


STOPS = (85.0, 176.0, 218.0, 304.0)
"""Mechanical stops of both [degrees]."""


def position(finger: int, pad: float) -> float:
    """Return where the servo of a finger is when its pad is `pad` [m] off the hand's centre plane."""
    crank = math.degrees(math.acos((pad - 0.038 + 0.02377) / math.hypot(0.039824, 0.020953)))
    angle = 150.0 + (crank - 90.0) if finger == 0 else 245.0 - (crank - 90.0)
    return angle * 1023.0 / 300.0


@dataclass
class Hand:
    """A hand: controller, driver, bus, servos; time is simulated."""

    bus: SimulatedBus = field(
        default_factory=lambda: SimulatedBus({i + 1: SimulatedAx12(i + 1, OPEN[i] * 1023.0 / 300.0) for i in range(2)})
    )
    t: float = 0.0
    reports: list[HandState] = field(default_factory=list)
    faults: list[tuple[float, str]] = field(default_factory=list)
    states: list[tuple[float, GripState]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.driver = MagpieServos(MagpieServoConfig(self.bus.line.name), self.bus.connect)
        self.controller = MagpieHand(MagpieConfig(max_gap=0.104))
        self.a, self.b = self.bus.servos[1], self.bus.servos[2]
        self.a.low, self.a.high, self.b.low, self.b.high = (x * 1023.0 / 300.0 for x in STOPS)

    def put(self, width: float, offset: float = 0.0) -> None:
        """Put a part between the fingers, its middle `offset` [m] towards finger a."""
        self.a.high = min(position(0, 0.5 * width + offset), self.a.high)
        self.b.low = max(position(1, 0.5 * width - offset), self.b.low)

    def run(self, seconds: float) -> None:
        """Let everything run; what the driver raises is noted."""
        for _ in range(round(seconds / DT)):
            self.t += DT
            try:
                report = self.driver.step(self.t)
            except HandFault as fault:
                self.faults.append((self.t, str(fault)))
                report = None
            if report is not None:
                self.reports.append(report)
            if self.reports and round(self.t / DT) % 5 == 0:
                self.driver.command(self.controller.step(self.reports[-1], self.t))
                self.states.append((self.t, self.controller.status().state))
            self.bus.step(self.t, DT)

    def grip(self, force: float = 8.0, width: float = 0.010, offset: float = 0.0) -> None:
        """Close on a part."""
        self.put(width, offset)
        self.controller.close(force)
        self.run(1.5)
        assert self.controller.status().state is GripState.HOLDING
        assert not self.faults

    @property
    def state(self) -> GripState:
        return self.controller.status().state


@pytest.fixture
def hand() -> Iterator[Hand]:
    hand = Hand()
    hand.run(0.1)
    yield hand
    hand.driver.close()
    hand.bus.line.close()


def test_it_opens_and_reports_a_hundred_times_a_second(hand: Hand) -> None:
    hand.run(1.0)
    assert hand.state is GripState.OPEN
    assert 95 <= sum(report.t > hand.t - 1.0 for report in hand.reports) <= 101
    assert hand.reports[-1].gap == pytest.approx(hand.reports[-1].fingers.sum()) and hand.reports[-1].gap > 0.102
    assert (hand.driver.lost, hand.driver.strays, hand.driver.parser.skipped, hand.faults) == (0, 0, 0, [])


@pytest.mark.parametrize("gap", [0.005, 0.02, 0.05, 0.09, 0.10])
def test_a_commanded_gap_is_reached_and_reported_within_two_ticks_of_the_servos(hand: Hand, gap: float) -> None:
    hand.controller.open(gap)
    hand.run(2.0)
    assert hand.state is GripState.OPEN
    assert hand.reports[-1].gap == pytest.approx(gap, abs=0.0005)
    assert hand.a.position == pytest.approx(position(0, 0.5 * gap), abs=1.0)
    assert hand.b.position == pytest.approx(position(1, 0.5 * gap), abs=1.0)


@pytest.mark.parametrize("force", [0.15, 0.2, 0.5, 1.0, 3.0, 8.0, 12.0, 16.0, 16.1])
def test_the_force_is_the_commanded_one_and_its_error_is_less_than_a_step(hand: Hand, force: float) -> None:
    hand.grip(force)
    pressed = hand.reports[-1].force
    assert np.abs(pressed - clamp_force(force)).max() <= 0.04
    assert abs(pressed.sum() - 2.0 * force) <= 0.08


@pytest.mark.parametrize("force", [0.5, 4.0, 16.0])
def test_contact_is_noticed_within_two_ticks(hand: Hand, force: float) -> None:
    hand.put(0.020)
    hand.controller.close(force)
    while not (hand.a.blocked and hand.b.blocked):
        hand.run(DT)
    touched = hand.t
    hand.run(0.1)
    noticed = next(t for t, state in hand.states if state is GripState.CONTACT)
    assert noticed - touched <= 2 * PERIOD + 1e-9
    assert not any(state is GripState.CONTACT for t, state in hand.states if t < touched)


@pytest.mark.parametrize("offset", [-0.011, -0.004, 0.004, 0.011])
def test_a_part_off_centre_is_pressed_from_both_sides(hand: Hand, offset: float) -> None:
    hand.grip(6.0, width=0.012, offset=offset)
    assert np.abs(hand.reports[-1].force - 6.0).max() <= 0.04
    assert hand.controller.status().offset == pytest.approx(offset, abs=3e-4)
    assert hand.reports[-1].gap == pytest.approx(0.012, abs=3e-4)


def test_an_empty_hand_says_so(hand: Hand) -> None:
    hand.put(0.0)
    hand.controller.close(4.0)
    hand.run(1.5)
    assert hand.state is GripState.EMPTY


def test_one_percent_of_lost_answers_does_no_harm(hand: Hand) -> None:
    hand.bus.loss = 0.01
    hand.grip()
    hand.run(20.0)
    assert hand.driver.lost > 50 and not hand.faults and hand.state is GripState.HOLDING
    assert np.diff([report.t for report in hand.reports]).max() < 0.05
    assert len(hand.reports) > 95 * hand.t


def test_lost_and_damaged_answers_are_never_read_as_no_load(hand: Hand) -> None:
    hand.grip(8.0)
    hand.bus.loss = hand.bus.damage = 0.15
    before = len(hand.reports)
    hand.run(20.0)
    assert len(hand.reports) - before > 500 and hand.driver.parser.skipped > 500
    for report in hand.reports[before:]:
        assert np.abs(report.force - 8.0).max() <= 0.04
        assert report.gap == pytest.approx(0.010, abs=3e-4)


@pytest.mark.parametrize("delay", [0.006, 0.03, 0.3])
def test_answers_that_come_late_are_no_answers(hand: Hand, delay: float) -> None:
    hand.grip()
    hand.bus.delay = delay
    late = hand.t
    hand.run(1.0)
    first = hand.faults[0][0] - late
    assert first <= 0.1 and "does not answer" in hand.faults[0][1]
    assert not [report for report in hand.reports if report.t > late + 0.02]
    assert hand.driver.strays > 0


def test_the_cable_is_missed_within_a_tenth_of_a_second_and_found_again(hand: Hand) -> None:
    hand.grip()
    hand.bus.unplug()
    pulled = hand.t
    hand.run(0.3)
    assert hand.faults[0][0] - pulled <= 0.1 and "is gone" in hand.faults[0][1]
    assert hand.reports[-1].t <= pulled + DT
    hand.bus.plug_in()
    hand.run(1.2)
    hand.faults.clear()
    hand.run(0.2)
    assert not hand.faults and hand.state is GripState.SLIPPED
    hand.controller.close(8.0)
    hand.run(0.3)
    assert hand.state is GripState.HOLDING


@pytest.mark.parametrize("servo", [1, 2])
def test_a_servo_that_dies_while_it_holds_is_missed_and_the_other_one_holds_on(hand: Hand, servo: int) -> None:
    hand.grip(8.0)
    hand.bus.servos[servo].dead = True
    died = hand.t
    hand.run(0.5)
    assert hand.faults[0][0] - died <= 0.1
    assert f"Servo {servo} " in hand.faults[0][1] and "does not answer" in hand.faults[0][1]
    assert not [report for report in hand.reports if report.t > died + 2 * PERIOD]
    assert hand.state is GripState.SLIPPED  # nobody knows, so nobody may believe in it
    other = hand.bus.servos[3 - servo]
    assert other.blocked and abs(other.load) > 200


def test_a_servo_that_was_without_power_gets_its_limits_back(hand: Hand) -> None:
    hand.grip(2.0)
    limit = hand.a.word(34)
    assert limit < 200
    hand.a.power_up()
    assert (hand.a.word(34), hand.a.word(32)) == (1023, 0)
    hand.run(0.01)
    assert (hand.a.word(34), hand.a.word(32), hand.a.table[24]) == (limit, 100, 1)


@pytest.mark.parametrize(("bit", "text"), [(0x20, "overload"), (0x04, "overheated"), (0x01, "input voltage")])
def test_what_a_servo_says_is_wrong_with_it_is_raised(hand: Hand, bit: int, text: str) -> None:
    hand.grip()
    hand.b.error = bit
    hand.run(0.02)
    assert text in hand.faults[-1][1] and "Servo 2 " in hand.faults[-1][1]
    hand.b.error = 0
    hand.run(0.02)
    hand.faults.clear()
    hand.run(0.1)
    assert not hand.faults


def shut_down(hand: Hand, servo: SimulatedAx12, bit: int) -> None:
    """Let a servo that holds a part do what an AX-12A does by itself: no torque."""
    hand.grip()
    servo.error = bit
    servo.table[34:36] = b"\0\0"
    hand.run(0.1)
    assert text_of(hand, bit)


def text_of(hand: Hand, bit: int) -> bool:
    return ("overload" if bit == 0x20 else "overheated") in hand.faults[-1][1]


@pytest.mark.parametrize("bit", [0x20, 0x04])
@pytest.mark.parametrize("clears", [False, True], ids=["its error stays", "its error goes"])
def test_a_servo_that_shut_itself_down_is_left_alone(hand: Hand, bit: int, clears: bool) -> None:
    shut_down(hand, hand.b, bit)
    if clears:
        hand.b.error = 0
    hand.run(1.0)
    assert hand.b.word(34) == 0 and hand.a.word(34) > 0
    assert hand.faults[-1][0] == pytest.approx(hand.t) and text_of(hand, bit)
    assert hand.reports[-1].t < hand.t - 0.9


@pytest.mark.parametrize("servo", [1, 2])
@pytest.mark.parametrize("clears", [False, True], ids=["its error stays", "its error goes"])
def test_another_gap_ends_a_shutdown(hand: Hand, servo: int, clears: bool) -> None:
    down = hand.bus.servos[servo]
    shut_down(hand, down, 0x20)
    down.error = 0 if clears else 0x20
    hand.driver.command(HandCommand(0.0, 0.0, 9.0))  # the same gap with another force is no new command
    for _ in range(50):
        hand.t += DT
        with pytest.raises(HandFault, match="overload"):
            hand.driver.step(hand.t)
        hand.bus.step(hand.t, DT)
    assert down.word(34) == 0
    hand.controller.open(0.08)
    hand.run(0.05)
    assert down.word(34) > 0
    down.error = 0  # where it stayed, it stayed until it was written to
    hand.run(0.02)
    hand.faults.clear()
    hand.run(0.05)
    assert not hand.faults and hand.reports[-1].t > hand.t - 0.02


def test_power_that_was_off_ends_a_shutdown(hand: Hand) -> None:
    shut_down(hand, hand.b, 0x20)
    hand.b.dead = True
    hand.run(0.2)
    hand.b.dead, hand.b.error = False, 0
    hand.b.power_up()
    hand.run(0.05)
    hand.faults.clear()
    hand.run(0.1)
    assert hand.b.word(34) > 0 and not hand.faults


def test_nothing_moves_before_the_first_command() -> None:
    bus = SimulatedBus({i: SimulatedAx12(i, 400.0) for i in (1, 2)})
    driver = MagpieServos(MagpieServoConfig(bus.line.name), bus.connect)
    reports = []
    for i in range(200):
        reports.append(driver.step(i * DT))
        bus.step(i * DT, DT)
    assert sum(report is not None for report in reports) > 30
    assert [servo.position for servo in bus.servos.values()] == [400.0, 400.0]
    assert not any(servo.table[24] for servo in bus.servos.values())
    driver.close()
    bus.line.close()


def test_a_hand_that_fails_fails_alone() -> None:
    left, right = Hand(), Hand()
    for hand in (left, right):
        hand.run(0.1)
        hand.put(0.010)
        hand.controller.close(8.0)
    right.run(1.5)
    left.run(1.5)
    left.bus.unplug()
    for _ in range(100):
        left.run(DT)
        right.run(DT)
    assert left.faults and not right.faults
    assert right.state is GripState.HOLDING and right.reports[-1].t > right.t - 2 * PERIOD


def test_an_opening_finger_stays_off_its_stop_and_a_closing_one_is_sent_beyond_it(hand: Hand) -> None:
    hand.controller.close(4.0)
    hand.run(0.1)
    assert hand.a.word(30) == round(176.0 * 3.41) + 32 and hand.b.word(30) == round(218.0 * 3.41) - 32
    hand.controller.config = MagpieConfig()
    hand.controller.open(magpie_model.MAX_GAP)
    hand.run(0.1)
    assert hand.a.word(30) >= round(89.0 * 3.41) and hand.b.word(30) == 1023


def test_a_command_that_is_no_number_is_refused(hand: Hand) -> None:
    for command in (HandCommand(0.0, math.nan, 4.0), HandCommand(0.0, 0.05, math.inf)):
        with pytest.raises(ValueError, match="finite"):
            hand.driver.command(command)


def test_two_servos_cannot_have_one_id() -> None:
    with pytest.raises(ConfigError, match="each needs its own"):
        MagpieServoConfig("/dev/ttyUSB0", b=FingerConfig(1, 245.0, -1, 218.0, 304.0))


@pytest.mark.parametrize(
    ("options", "range_"),
    [
        ({"speed": 0}, "speed .* 1 to 1023, not 0"),
        ({"margin": 256}, "margin .* 0 to 255, not 256"),
        ({"slope": 1}, "slope .* 2 to 128, not 1"),
        ({"a": FingerConfig(300, 150.0, 1, 85.0, 176.0)}, "id .* 0 to 253, not 300"),
        ({"b": FingerConfig(2, 245.0, 0, 218.0, 304.0)}, "clockwise, -1"),
    ],
)
def test_what_no_servo_can_be_told_is_refused_at_the_start(options: dict[str, Any], range_: str) -> None:
    with pytest.raises(ConfigError, match=range_):
        MagpieServoConfig("/dev/ttyUSB0", **options)
