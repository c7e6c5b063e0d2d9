"""The e-stop firmware as it is flashed, run on a simulated Arduino Uno; time is the board's own."""

from __future__ import annotations

import pytest
from tests.firmware.conftest import Uno
from tests.hardware.conftest import DT, Bench

from golem.hardware.estop.serial_board import BoardFrame, FrameParser, SerialEstop
from golem.hardware.safety.base import OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import Gate
from golem.interfaces.payloads import EstopMessage, GateState, Reason


def frames(uno: Uno, seconds: float) -> list[BoardFrame]:
    """Let the board run and return what it says."""
    parser = FrameParser()
    uno.run(seconds)
    found = parser.feed(uno.port.read())
    assert parser.skipped == 0
    return found


def test_it_starts_pressed_and_is_released_after_fifty_milliseconds(uno: Uno) -> None:
    said = frames(uno, 0.105)
    assert [frame.sequence for frame in said] == list(range(10))
    assert [frame.pressed for frame in said] == [True] * 4 + [False] * 6
    assert not any(frame.echo for frame in said)


def test_an_open_contact_is_a_press_at_once_and_a_release_takes_fifty_milliseconds(uno: Uno) -> None:
    frames(uno, 0.205)
    uno.say("press")
    assert all(frame.pressed for frame in frames(uno, 0.1))
    uno.say("release")
    assert [frame.pressed for frame in frames(uno, 0.1)] == [True] * 5 + [False] * 5


def test_a_contact_that_was_open_for_two_milliseconds_is_in_five_frames(uno: Uno) -> None:
    frames(uno, 0.202)
    uno.say("press")
    said = frames(uno, 0.002)
    uno.say("release")
    said += frames(uno, 0.1)
    assert sum(frame.pressed for frame in said) == 5


@pytest.mark.parametrize(
    "fault", ["weld", "cut 2", "cut 3", "ground 2", "ground 3", "flip 2b 2", "flip 2b 3", "flip 2a 2", "flip 2a 5"]
)
@pytest.mark.parametrize("before", [pytest.param(True, marks=(pytest.mark.slow, pytest.mark.long)), False])
def test_no_single_fault_hides_a_press(fault: str, before: bool, uno: Uno) -> None:
    frames(uno, 0.105)
    for word in (fault, "press") if before else ("press", fault):
        uno.say(word)
        said = frames(uno, 0.1)
    assert all(frame.pressed for frame in said)


@pytest.mark.parametrize("fault", ["cut 2", "ground 2", "ground 3"])
def test_a_bad_wire_is_a_press_at_once(fault: str, uno: Uno) -> None:
    assert not frames(uno, 0.105)[-1].pressed
    uno.say(fault)
    assert all(frame.pressed for frame in frames(uno, 0.1))


@pytest.mark.parametrize("register", ["2b 2", "2b 3", "2b 5", "2a 2", "2a 3", "2a 5"])
def test_a_bit_that_flips_is_set_right_again(register: str, uno: Uno) -> None:
    """PORTD is at 2b, DDRD at 2a."""
    frames(uno, 0.105)
    uno.say(f"flip {register}")
    assert not frames(uno, 0.2)[-1].pressed


def test_it_echoes_the_newest_byte(uno: Uno) -> None:
    frames(uno, 0.1)
    for sent in (b"\x00", b"\x5a", b"\xa5\x00", b"\x13", b"\x01\x02\xff"):
        uno.port.write(sent)
        assert frames(uno, 0.020)[-1].echo == sent[-1]


def test_its_watchdog_starts_a_board_that_hangs_again(uno: Uno) -> None:
    assert frames(uno, 0.505)[-1].sequence == 49
    uno.say("hang")
    said = frames(uno, 0.2)
    assert said[0].sequence == 0 and said[0].pressed
    assert not said[-1].pressed


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("count", [1000, pytest.param(10_000, marks=pytest.mark.long)])
def test_thousands_of_frames_have_no_error(uno: Uno, count: int) -> None:
    parser, said = FrameParser(), list[BoardFrame]()
    while len(said) < count:
        uno.run(1.0)
        said += parser.feed(uno.port.read())
    assert [frame.sequence for frame in said] == list(range(len(said)))
    assert parser.skipped == 0 and not any(frame.pressed for frame in said[5:])


class Watch:
    """The host and the gate behind a board, in the board's time."""

    def __init__(self, uno: Uno) -> None:
        self._uno, self._bench = uno, Bench(Gate(SafetyLimits.from_profile().still()))
        self.estop = SerialEstop(uno.port.name, connect=lambda name, baud: uno.port)
        self._newest: EstopMessage | None = None

    def run(self, seconds: float, request: OperatorRequest = OperatorRequest.NONE) -> float:
        """Let everything run; return for how long the gate stayed ACTIVE [s]."""
        active = 0
        for _ in range(round(seconds / DT)):
            self._uno.run(DT)
            self._newest = self.estop.step(self._bench.t + DT) or self._newest
            active += self._bench.tick(estop=self._newest, request=request).state is GateState.ACTIVE
        return active * DT

    @property
    def verdict(self) -> tuple[GateState, Reason | None]:
        """What the gate says."""
        return self._bench.results[-1].state, self._bench.results[-1].reason


@pytest.fixture
def watch(uno: Uno) -> Watch:
    """A board whose gate is ACTIVE."""
    watch = Watch(uno)
    watch.run(0.1)
    watch.run(DT, OperatorRequest.ACTIVATE)
    assert watch.verdict == (GateState.ACTIVE, None)
    return watch


def test_a_press_stops_the_robot_within_a_frame(uno: Uno, watch: Watch) -> None:
    assert watch.run(0.5) == pytest.approx(0.5) and watch.estop.age <= 0.017
    uno.say("press")
    assert watch.run(0.1) <= 0.014
    assert watch.verdict == (GateState.STOP1, Reason.ESTOP_PRESSED)
    assert watch.estop.skipped == watch.estop.lost == 0


def test_a_board_that_hangs_stops_the_robot(uno: Uno, watch: Watch) -> None:
    uno.say("hang")
    assert watch.run(0.2) <= 0.062
    assert watch.verdict == (GateState.STOP1, Reason.ESTOP_STALE)


def test_a_board_that_is_unplugged_stops_the_robot(uno: Uno, watch: Watch) -> None:
    uno.end()
    uno.run = lambda seconds: None  # there is nothing that could run
    assert watch.run(0.2) <= 0.062
    assert watch.verdict == (GateState.STOP1, Reason.ESTOP_STALE)
    assert "is gone" in watch.estop.fault
