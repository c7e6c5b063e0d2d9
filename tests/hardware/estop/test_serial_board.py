"""The host's side of the emergency-stop board, on a pseudo terminal, with the safety gate behind it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest
from tests.hardware.conftest import DT, Bench
from tests.hardware.drivers.board_frames import frame_bytes
from tests.hardware.drivers.pty_line import CountingPort, PtyLine

from golem.errors import ConfigError
from golem.hardware.drivers.serial_port import PortError, SerialPort
from golem.hardware.estop.base import EmergencyStop
from golem.hardware.estop.estop_config import EstopConfig, VirtualEstop
from golem.hardware.estop.serial_board import REOPEN, BoardFrame, SerialEstop
from golem.hardware.safety.base import OperatorRequest
from golem.interfaces.payloads import EstopMessage, GateState, Reason

PERIOD = 0.010


@dataclass
class Board:
    """The board at the other end of a line, and the gate that listens to its host; time is simulated."""

    bench: Bench
    line: PtyLine = field(default_factory=PtyLine)
    pressed: bool = False
    alive: bool = True
    deaf: bool = False
    delay: float = 0.0
    sequence: int = 0
    echo: int = 0
    due: float = 0.0
    under_way: list[tuple[float, bytes]] = field(default_factory=list)
    sent: list[bytes] = field(default_factory=list)
    newest: EstopMessage | None = None
    spoil: Callable[[bytes], bytes] = lambda frame: frame

    def __post_init__(self) -> None:
        self.ports: list[CountingPort] = []
        self.estop = SerialEstop(self.line.name, connect=self.connect)
        self.received = 0

    def connect(self, name: str, baud: int) -> SerialPort:
        """Open the port that the board is at by now."""
        assert baud == 115200
        self.ports.append(CountingPort(self.line.name, baud))
        self.received = 0
        return self.ports[-1]

    def run(self, seconds: float, request: OperatorRequest = OperatorRequest.NONE) -> None:
        """Let board, host and gate run."""
        for _ in range(round(seconds / DT)):
            t = self.bench.t + DT
            if self.alive and t >= self.due - 1e-9:
                self.due = t + PERIOD
                frame = frame_bytes(BoardFrame(self.sequence, self.pressed, self.echo))
                self.under_way.append((t + self.delay, frame))
                self.sequence = (self.sequence + 1) % 65536
            while self.under_way and self.under_way[0][0] <= t + 1e-9:
                self.sent.append(self.under_way.pop(0)[1])
                self.line.send(self.spoil(self.sent[-1]))
            self.newest = self.estop.step(t) or self.newest
            if self.alive and not self.deaf and self.ports[-1].written > self.received:
                self.echo = self.line.receive(self.ports[-1].written - self.received)[-1]
                self.received = self.ports[-1].written
            self.bench.tick(estop=self.newest, request=request)

    def reaction(self, seconds: float = 0.3) -> float:
        """Let everything run and return for how long the gate stayed ACTIVE meanwhile [s]."""
        before = len(self.bench.results)
        self.run(seconds)
        return DT * sum(result.state is GateState.ACTIVE for result in self.bench.results[before:])

    @property
    def verdict(self) -> tuple[GateState, Reason | None]:
        """What the gate says."""
        return self.bench.results[-1].state, self.bench.results[-1].reason


@pytest.fixture
def board(bench: Bench) -> Iterator[Board]:
    """A board whose gate is ACTIVE."""
    board = Board(bench)
    board.run(0.1)
    board.run(DT, OperatorRequest.ACTIVATE)
    assert board.verdict == (GateState.ACTIVE, None)
    yield board
    board.estop.close()
    board.line.close()


STALE = (GateState.STOP1, Reason.ESTOP_STALE)
PRESSED = (GateState.STOP1, Reason.ESTOP_PRESSED)
LIMIT = 0.050 + PERIOD + DT
"""Within which a board that has stopped to speak stops the robot [s]: the gate's age limit after the newest frame."""


def test_a_board_that_works_stops_nobody(board: Board) -> None:
    board.run(3.0)
    assert isinstance(board.estop, EmergencyStop)
    assert board.verdict == (GateState.ACTIVE, None) and board.estop.fault == ""
    # The first frame was made before the board had heard anything.
    assert (board.estop.lost, board.estop.late, board.estop.skipped) == (0, 1, 0)
    assert board.estop.age <= 0.010


def test_a_press_stops_within_a_frame(board: Board) -> None:
    board.pressed = True
    assert board.reaction() <= PERIOD + DT
    assert board.verdict == PRESSED


def test_a_press_counts_however_late_it_is(board: Board) -> None:
    board.alive = False
    board.line.send(frame_bytes(BoardFrame(3, True, 0)))
    assert board.reaction() <= DT
    assert board.verdict == PRESSED


def test_a_press_between_two_looks_of_the_host_is_not_missed(board: Board) -> None:
    frames = [BoardFrame(board.sequence + i, i == 1, board.echo) for i in range(3)]
    board.line.send(b"".join(map(frame_bytes, frames)))
    assert board.reaction() <= DT
    assert board.verdict == PRESSED


def test_silence_stops(board: Board) -> None:
    board.alive = False
    assert board.reaction() <= LIMIT
    assert board.verdict == STALE and board.estop.fault == f"{board.line.name} is silent"


@pytest.mark.parametrize("bit", [0, 20, 35, 47, 63])
def test_frames_with_a_wrong_bit_stop(board: Board, bit: int) -> None:
    def flipped(frame: bytes) -> bytes:
        return (int.from_bytes(frame, "little") ^ 1 << bit).to_bytes(8, "little")

    board.spoil = flipped
    assert board.reaction() <= LIMIT
    assert board.verdict == STALE and "no sound frame" in board.estop.fault
    assert board.estop.skipped > 0


def test_another_baud_rate_stops(board: Board) -> None:
    board.spoil = at_half_the_rate
    assert board.reaction() <= LIMIT
    assert board.verdict == STALE and "115200 baud" in board.estop.fault


def at_half_the_rate(frame: bytes) -> bytes:
    """Return what a receiver at 57600 baud takes `frame` for: every second bit, start and stop bits among them."""
    line = [bit for byte in frame for bit in (0, *(byte >> i & 1 for i in range(8)), 1)] + [1] * 20
    seen, at = bytearray(), 0
    while at + 20 <= len(line):
        if line[at]:
            at += 1
            continue
        seen.append(sum(line[at + 3 + 2 * i] << i for i in range(8)))
        at += 19
    return bytes(seen)


@pytest.mark.parametrize("delay", [0.045, 0.2, 2.56, 3.0])
def test_frames_that_come_late_stop(board: Board, delay: float) -> None:
    board.delay = delay
    assert board.reaction(delay + 0.5) <= LIMIT
    assert board.verdict[1] is Reason.ESTOP_STALE and "older than 30 ms" in board.estop.fault
    assert board.estop.late > 10


def test_frames_that_come_a_little_late_do_not(board: Board) -> None:
    board.delay = 0.014
    board.run(3.0)
    assert board.verdict == (GateState.ACTIVE, None) and 0.014 < board.estop.age <= 0.025


def test_recorded_frames_stop(board: Board) -> None:
    board.run(5.0)
    recorded = board.sent[-300:]
    board.alive = False
    board.under_way = [(board.bench.t + PERIOD * i, frame) for i, frame in enumerate(recorded)]
    assert board.reaction(2.0) <= 0.1  # one in nine bytes is that of a moment ago by chance
    assert board.verdict == STALE and board.estop.late > 150


def test_one_frame_again_and_again_stops(board: Board) -> None:
    frame = board.sent[-1]
    board.spoil = lambda _: frame
    assert board.reaction() <= 0.030 + LIMIT
    assert board.verdict == STALE


def test_three_lost_frames_in_a_row_do_not_stop_and_are_counted(board: Board) -> None:
    for _ in range(20):
        board.sequence += 3
        board.due += 3 * PERIOD
        board.run(0.1)
    assert board.verdict == (GateState.ACTIVE, None) and board.estop.lost == 60


def test_six_lost_frames_in_a_row_stop(board: Board) -> None:
    board.due += 6 * PERIOD
    board.run(0.1)
    assert board.verdict == STALE


def test_the_sequence_wraps(board: Board) -> None:
    board.sequence = 65530
    board.run(0.5)
    assert board.verdict == (GateState.ACTIVE, None)
    assert board.estop.lost == 0


def test_every_second_frame_garbled_does_not_stop(board: Board) -> None:
    board.spoil = lambda frame: frame if board.sequence % 2 else frame[:4] + b"\xff" + frame[5:]
    board.run(2.0)
    assert board.verdict == (GateState.ACTIVE, None) and board.estop.skipped > 500


def test_a_board_that_starts_again_stops_since_it_starts_pressed(board: Board) -> None:
    board.sequence, board.pressed = 0, True
    board.run(0.02)
    board.pressed = False
    board.run(0.1)
    assert board.verdict == PRESSED and board.estop.lost == 0


def test_an_unplugged_board_stops_and_comes_back_when_it_is_plugged_in(board: Board) -> None:
    board.line.unplug()
    board.alive = False
    assert board.reaction() <= LIMIT
    assert board.verdict == STALE and "is gone" in board.estop.fault
    board.run(2.0)
    board.line, board.alive = PtyLine(), True
    board.run(REOPEN + 0.1)
    assert board.estop.fault == ""
    board.run(DT, OperatorRequest.RESET)
    assert board.verdict == (GateState.ARMED, None)


def test_a_board_that_takes_nothing_holds_up_nobody(board: Board) -> None:
    port, board.deaf = board.ports[-1], True
    for _ in range(100):
        port.write(bytes(1000))  # far more than the kernel keeps
    assert board.reaction() <= 0.030 + LIMIT
    assert board.verdict == STALE and "older" in board.estop.fault


def test_a_port_that_is_not_there_is_named() -> None:
    with pytest.raises(PortError, match="'/dev/no_such_board' cannot be opened: No such file"):
        SerialEstop("/dev/no_such_board")


def test_a_port_belongs_to_one_process(board: Board) -> None:
    with pytest.raises(PortError, match="another process has it"):
        SerialEstop(board.line.name)


def test_the_config_says_which() -> None:
    assert isinstance(EstopConfig().create(), VirtualEstop) and EstopConfig().words() == []
    config = EstopConfig("serial", "/dev/ttyACM0", 0.02)
    assert config.words() == [
        *("--estop.use", "serial"),
        *("--estop.port", "/dev/ttyACM0"),
        *("--estop.oldest", "0.02"),
    ]
    with pytest.raises(ConfigError, match="estop: {use: serial, port: /dev/ttyACM0}"):
        EstopConfig("serial")
    with pytest.raises(ConfigError, match="estop: {use: serial, port: /dev/ttyACM0}"):
        EstopConfig(port="/dev/ttyACM0")
    with pytest.raises(ConfigError, match="0.01 to 0.05 s, not 1"):
        EstopConfig("serial", "/dev/ttyACM0", 1.0)
