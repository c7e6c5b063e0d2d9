"""The emergency-stop board of firmware/estop, on a serial port.

A frame counts only if it was made a moment ago. Its stamp of reception does not say so: an operating system or a USB
hub that was held up delivers seconds of old frames at once. So the host keeps sending bytes, each other than the last,
and the board puts the newest one into its frame. A frame with the byte of a moment ago cannot be older than that byte.
"""

from __future__ import annotations

import binascii
import math
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from golem.hardware.drivers.serial_port import PortError, SerialPort
from golem.interfaces.payloads import EstopMessage

SIZE = 8
"""Bytes of a frame."""
SYNC = b"\xa5\x5a"
"""How a frame begins."""
RELEASED, PRESSED = 0x3C, 0xC3
"""The two states; all eight bits differ."""
SEQUENCES = 1 << 16
"""How many sequence numbers there are."""


@dataclass(frozen=True, slots=True)
class BoardFrame:
    """What one frame says.

    Attributes:
        sequence: counts up by one per frame, 0 to 65535, and wraps.
        pressed: whether the button is pressed, or its wire cut.
        echo: the newest byte that the board had received, 0 to 255.
    """

    sequence: int
    pressed: bool
    echo: int


def checksum(data: bytes) -> int:
    """Return the CRC-16/CCITT-FALSE of `data`: polynomial 0x1021, start 0xFFFF."""
    return binascii.crc_hqx(data, 0xFFFF)


class FrameParser:
    """Finds frames among bytes, also after those that are none; `skipped` belonged to no sound frame."""

    def __init__(self) -> None:
        self.skipped = 0
        self._rest = b""

    def feed(self, data: bytes) -> list[BoardFrame]:
        """Return the sound frames that `data` completes, in order; what may begin one is kept for the next call."""
        data = self._rest + data
        frames: list[BoardFrame] = []
        at = 0
        while len(data) - at >= SIZE:
            frame = _decode(data[at : at + SIZE])
            if frame is not None:
                frames.append(frame)
                at += SIZE
                continue
            self.skipped += 1
            at += 1
        self._rest = data[at:]
        return frames


def _decode(data: bytes) -> BoardFrame | None:
    body, state = data[:-2], data[4]
    if body[:2] != SYNC or state not in (RELEASED, PRESSED):
        return None
    if checksum(body) != int.from_bytes(data[-2:], "little"):
        return None
    return BoardFrame(int.from_bytes(body[2:4], "little"), state == PRESSED, body[5])


BAUD = 115200
"""Of the board [1/s]."""
CHALLENGE = 0.005
"""Time between two bytes to the board [s]: half of its frame period."""
RECENT = 0.050
"""Time for which bytes and frames count as coming, when it is to be said what is wrong [s]."""
REOPEN = 1.0
"""Time between two attempts to open a port that is gone [s]."""
LARGE_GAP = 1000
"""Frames from which a step of the sequence is a board that was started again, and no loss."""


class SerialEstop:
    """Frames of the board; a press counts however late it is, a release only while it is fresh.

    Attributes:
        lost: frames that the sequence says were sent and that did not come.
        late: frames that were older than they may be.
        age: greatest age that the newest fresh frame may have had [s]; nan before the first.
    """

    def __init__(
        self, port: str, oldest: float = 0.030, connect: Callable[[str, int], SerialPort] = SerialPort
    ) -> None:
        """Open the board.

        Args:
            port: path of its serial port, e.g. /dev/ttyACM0.
            oldest: age up to which a frame is fresh [s].
            connect: opens a port by name and baud rate.

        Raises:
            MissingExtra: pyserial is absent.
            PortError: the port cannot be opened.
        """
        self.lost, self.late, self.age = 0, 0, math.nan
        self._name, self._oldest, self._connect = port, oldest, connect
        self._open: SerialPort | None = connect(port, BAUD)
        self._parser = FrameParser()
        self._random = random.Random(0)  # of a byte that merely counted up, a delay of 256 would look like none
        self._sent: deque[tuple[float, int]] = deque()
        self._last: BoardFrame | None = None
        self._now = self._retry = self._bytes = self._frames = self._counted = -math.inf
        self._gone = ""

    @property
    def skipped(self) -> int:
        """Bytes that belonged to no sound frame."""
        return self._parser.skipped

    @property
    def fault(self) -> str:
        """Why no frame that counts has come lately; empty while they come."""
        if self._gone:
            return self._gone
        if self._now - self._counted <= RECENT:
            return ""
        if self._now - self._frames <= RECENT:
            return f"the frames from {self._name} are older than {self._oldest * 1e3:.0f} ms"
        if self._now - self._bytes <= RECENT:
            return f"what comes from {self._name} holds no sound frame: is it the board, at {BAUD} baud?"
        return f"{self._name} is silent"

    def step(self, t: float) -> EstopMessage | None:
        """Take what has come by `t` [s] and return the newest frame that counts, None if none does. Never waits."""
        self._now = t
        try:
            data = self._exchange(t)
        except PortError as error:
            self._lose(t, str(error))
            return None
        if data:
            self._bytes = t
        frames = self._parser.feed(data)
        for frame in frames:
            self._count(frame)
        if frames:
            self._frames = t
        fresh = [frame for frame in frames if self._fresh_enough(frame, t)]
        self.late += len(frames) - len(fresh)
        counts = [frame for frame in frames if frame.pressed] or fresh
        if not counts:
            return None
        self._counted = t
        return EstopMessage(t, counts[-1].sequence, counts[-1].pressed)

    def close(self) -> None:
        """Close the port."""
        if self._open is not None:
            self._open.close()
            self._open = None

    def _exchange(self, t: float) -> bytes:
        if self._open is None:
            if t < self._retry:
                return b""
            self._open, self._parser, self._gone = self._connect(self._name, BAUD), FrameParser(), ""
        data = self._open.read()
        while self._sent and self._sent[0][0] < t - self._oldest:
            self._sent.popleft()
        if not self._sent or t - self._sent[-1][0] >= CHALLENGE:
            byte = self._random.randrange(256)
            self._open.write(bytes((byte,)))
            self._sent.append((t, byte))
        return data

    def _lose(self, t: float, why: str) -> None:
        self.close()
        self._gone, self._retry, self._last = why, t + REOPEN, None
        self._sent.clear()

    def _fresh_enough(self, frame: BoardFrame, t: float) -> bool:
        for sent, byte in self._sent:
            if byte == frame.echo:
                self.age = t - sent
                return True
        return False

    def _count(self, frame: BoardFrame) -> None:
        if self._last is not None:
            gap = (frame.sequence - self._last.sequence - 1) % SEQUENCES
            self.lost += gap if gap < LARGE_GAP else 0
        self._last = frame
