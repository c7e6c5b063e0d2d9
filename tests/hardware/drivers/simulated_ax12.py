"""AX-12A servos that speak bytes, on a pseudo terminal, with what can go wrong on a bus. Time is simulated.

Written from the e-manual a second time: it shares no code with the driver.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field

from tests.hardware.drivers.pty_line import CountingPort, PtyLine

TICKS_PER_SPEED = 0.111 * 360.0 / 60.0 * 1023.0 / 300.0
"""Positions per second for each unit of the moving speed."""
FRICTION = 50
"""Load of a servo that moves freely."""


class SimulatedAx12:
    """One servo. It moves to its goal unless something is in its way, and presses with at most its torque limit.

    Attributes:
        position: 0 to 1023.
        low, high: between which positions nothing is in its way.
        dead: whether it has no power: it neither moves nor answers.
        error: bits that it puts into its answers.
        blocked: whether it presses against something.
    """

    def __init__(self, servo: int, position: float) -> None:
        self.id = servo
        self.position = position
        self.low, self.high = 0.0, 1023.0
        self.dead = self.blocked = False
        self.error = 0
        self.load = 0
        self.power_up()

    def power_up(self) -> None:
        """Come up as from the factory: full torque, no limit of the speed."""
        self.table = bytearray(50)
        self.table[0:2] = b"\x0c\x00"
        self.table[26:30] = bytes((1, 1, 32, 32))
        self.table[34:36] = b"\xff\x03"
        self.table[42:44] = bytes((120, 31))

    def word(self, address: int) -> int:
        """Return a number of two bytes of its table."""
        return self.table[address] + 256 * self.table[address + 1]

    def advance(self, dt: float) -> None:
        """Let it move for `dt` [s]."""
        self.load, self.blocked = 0, False
        if self.dead or not self.table[24]:
            return
        lag = self.word(30) - self.position
        reach = (self.word(32) or 1023) * TICKS_PER_SPEED * dt
        limit = self.word(34)
        self.position += max(-reach, min(reach, lag))
        stopped = max(self.low, min(self.high, self.position))
        self.blocked, self.position = stopped != self.position, stopped
        if self.blocked:
            lag = self.word(30) - self.position
            self.load = round(max(-1.0, min(1.0, lag / 32.0)) * limit)
        elif abs(lag) > 1.0:
            self.load = min(FRICTION, limit) * (1 if lag > 0 else -1)

    def answer(self, instruction: int, parameters: bytes) -> bytes:
        """Do what an instruction says and return the status, empty for none."""
        if self.dead:
            return b""
        for address, value in ((36, round(self.position)), (40, abs(self.load) + 1024 * (self.load < 0))):
            self.table[address] = value & 255
            self.table[address + 1] = value >> 8
        if instruction == 2:  # read
            address, size = parameters
            return self._status(bytes(self.table[address : address + size]))
        assert instruction == 1, f"instruction {instruction}"  # ping
        return self._status(b"")

    def write(self, address: int, data: bytes) -> None:
        """Write to its table."""
        if not self.dead:
            self.table[address : address + len(data)] = data

    def _status(self, parameters: bytes) -> bytes:
        body = bytes((self.id, len(parameters) + 2, self.error)) + parameters
        return b"\xff\xff" + body + bytes((255 - sum(body) % 256,))


@dataclass
class SimulatedBus:
    """Servos on a line.

    Attributes:
        servos: by id.
        loss: share of the answers that do not come.
        damage: share of the answers of which one bit is wrong.
        delay: time that answers take [s].
    """

    servos: dict[int, SimulatedAx12]
    loss: float = 0.0
    damage: float = 0.0
    delay: float = 0.0
    line: PtyLine = field(default_factory=PtyLine)
    unplugged: bool = False
    random: random.Random = field(default_factory=lambda: random.Random(1))

    def __post_init__(self) -> None:
        self.ports: list[CountingPort] = []
        self._received = 0
        self._pending: list[tuple[float, bytes]] = []

    def connect(self, name: str, baud: int) -> CountingPort:
        """Open the host's end."""
        assert baud == 1_000_000
        self.ports.append(CountingPort(self.line.name, baud))
        self._received = 0
        return self.ports[-1]

    def unplug(self) -> None:
        """Pull the cable."""
        self.line.unplug()
        self.unplugged = True

    def plug_in(self) -> None:
        """Plug the cable in again."""
        self.line, self.unplugged = PtyLine(), False

    def step(self, t: float, dt: float) -> None:
        """Take what the host has sent by `t` [s], answer it, and let the servos move for `dt` [s]."""
        if not self.unplugged:
            new = self.ports[-1].written - self._received
            self._received = self.ports[-1].written
            self._take(self.line.receive(new) if new else b"", t)
            while self._pending and self._pending[0][0] <= t + 1e-9:
                self.line.send(self._pending.pop(0)[1])
        for servo in self.servos.values():
            servo.advance(dt)

    def _take(self, data: bytes, t: float) -> None:
        while data:
            assert data[:2] == b"\xff\xff", data.hex()
            size = data[3] + 4
            packet, data = data[:size], data[size:]
            assert sum(packet[2:]) % 256 == 255, packet.hex()
            self._obey(packet[2], packet[4], packet[5:-1], t)

    def _obey(self, servo: int, instruction: int, parameters: bytes, t: float) -> None:
        if instruction == 0x83:
            assert servo == 0xFE
            address, size, rows = parameters[0], parameters[1], parameters[2:]
            while rows:
                if rows[0] in self.servos:
                    self.servos[rows[0]].write(address, rows[1 : size + 1])
                rows = rows[size + 1 :]
            return
        if servo not in self.servos:
            return
        answer = self.servos[servo].answer(instruction, parameters)
        if answer and self.random.random() >= self.loss:
            if self.random.random() < self.damage:
                bit = self.random.randrange(8 * len(answer))
                answer = (int.from_bytes(answer, "little") ^ 1 << bit).to_bytes(len(answer), "little")
            self._pending.append((t + self.delay, answer))
