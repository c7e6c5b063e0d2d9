"""Driver of one MAGPIE hand: two AX-12A on a serial bus, told a gap and a force, reporting gap and forces.

The servos hold the force by themselves: their torque limit is its ceiling, as in the twin. A closing finger is sent
beyond its stop by as much as the servo is soft, so that both press with their full force wherever the part stands.

Everything a servo forgets without power is written again and again: one that has been off would else come back with its
full torque and speed. What was not read is no report: a hand that does not answer raises.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from golem.errors import ConfigError, GolemError
from golem.hardware.drivers import ax12
from golem.hardware.drivers.dynamixel import (
    CHECKSUM_ERROR,
    StatusPacket,
    StatusParser,
    read_packet,
    sync_write_packet,
)
from golem.hardware.drivers.magpie_force import force_from_load, load_from_force
from golem.hardware.drivers.serial_port import PortError, SerialPort
from golem.robots.model import magpie_model
from golem.types import HandCommand, HandState

PERIOD = 0.010
"""Time between two reports [s]."""
ANSWER = 0.005
"""Time in which a servo answers [s]: on the wire 0.7 ms, the rest is for the adapter and the operating system."""
LOST = 0.050
"""Time without an answer from which a servo is lost [s]: eight questions."""
REOPEN = 1.0
"""Time between two attempts to open a port that is gone [s]."""
EDGE = 4.0
"""How far from its stop an opening finger stays [degrees] (magpie_control)."""


class HandFault(GolemError):
    """A hand that cannot be trusted: it does not answer, or a servo says that something is wrong with it."""


@dataclass(frozen=True, slots=True)
class FingerConfig:
    """One finger's servo.

    Attributes:
        id: of the servo.
        upright: its angle when the crank is square to the closing axis [degrees].
        closes: 1 if it turns counter-clockwise while closing, -1 if clockwise.
        lower, upper: its mechanical stops [degrees].
    """

    id: int
    upright: float
    closes: int
    lower: float
    upper: float


@dataclass(frozen=True, slots=True)
class MagpieServoConfig:
    """Options of `MagpieServos`; the defaults are those of the lab's driver, magpie_control.

    Attributes:
        port: path of the bus's serial port, e.g. /dev/ttyUSB0.
        a: the finger on +y of the hand.
        b: the finger on -y.
        speed: of the servos, 1 to 1023; 100 is 11 rpm.
        margin, slope: compliance around the goal, in positions.
    """

    port: str = ""
    a: FingerConfig = FingerConfig(1, 150.0, 1, 85.0, 176.0)
    b: FingerConfig = FingerConfig(2, 245.0, -1, 218.0, 304.0)
    speed: int = 100
    margin: int = 1
    slope: int = 32

    def __post_init__(self) -> None:
        if self.a.id == self.b.id:
            raise ConfigError(f"The two servos of a hand have the id {self.a.id}; each needs its own.")


class _Finger:
    """What is known of one finger."""

    def __init__(self, config: FingerConfig) -> None:
        self.config = config
        self.state: ax12.Ax12State | None = None
        self.heard = -math.inf
        self.trouble = ""

    def goal(self, gap: float) -> int:
        """Return the position for a `gap` [m] that is not 0, at a distance from the finger's stops."""
        c = self.config
        crank = magpie_model.ANGLE_OPEN + float(magpie_model.crank_from_gap(gap))
        angle = c.upright + c.closes * math.degrees(crank - 0.5 * math.pi)
        return _ticks(min(max(angle, c.lower + EDGE), c.upper - EDGE))

    def closed(self, slope: int) -> int:
        """Return the position beyond the finger's stop that a closing servo with this `slope` is sent to."""
        c = self.config
        return _ticks(c.upper) + slope if c.closes > 0 else _ticks(c.lower) - slope

    def pad(self, state: ax12.Ax12State) -> float:
        """Return the distance of the pad from the hand's centre plane [m]."""
        c = self.config
        angle = c.closes * (state.position * ax12.RANGE / ax12.TICKS - c.upright)
        return float(magpie_model.pad_offset(math.radians(angle) + 0.5 * math.pi - magpie_model.ANGLE_OPEN))

    def force(self, state: ax12.Ax12State) -> float:
        """Return the force with which the pad presses [N]; 0 for a load that opens."""
        return force_from_load(max(self.config.closes * state.load, 0))


class MagpieServos:
    """Speaks to the servos of one hand. Never waits: it has to be stepped every 2 ms or so.

    Attributes:
        lost: questions without an answer in time.
        strays: answers to no question, among them those that came too late.
    """

    def __init__(
        self, config: MagpieServoConfig, connect: Callable[[str, int], SerialPort] = SerialPort
    ) -> None:
        """Open the bus; nothing moves before the first command.

        Args:
            config: its options.
            connect: opens a port by name and baud rate.

        Raises:
            MissingExtra: pyserial is absent.
            PortError: the port cannot be opened.
        """
        self.config = config
        self.lost = self.strays = 0
        self._connect = connect
        self._port: SerialPort | None = connect(config.port, ax12.BAUD)
        self._parser = StatusParser()
        self._fingers = (_Finger(config.a), _Finger(config.b))
        self._settings: bytes = b""
        self._asked: tuple[_Finger, int, float] | None = None
        self._turn = self._size = 0
        self._reported = self._retry = -math.inf
        self._started = math.nan
        self._gone = ""

    @property
    def skipped(self) -> int:
        """Bytes that belonged to no sound packet."""
        return self._parser.skipped

    def command(self, command: HandCommand) -> None:
        """Take what the hand is told from now on; gap and force are limited to what it can do.

        Raises:
            ValueError: a number is not finite.
        """
        if not (math.isfinite(command.gap) and math.isfinite(command.force)):
            raise ValueError(f"A hand is told finite numbers, not {command}.")
        force = min(max(command.force, magpie_model.MIN_FORCE), magpie_model.MAX_FORCE)
        c, limit = self.config, load_from_force(force)
        settings: dict[int, bytes] = {}
        for finger in self._fingers:
            goal = finger.goal(command.gap) if command.gap > 0.0 else finger.closed(c.slope)
            settings[finger.config.id] = ax12.settings(goal, c.speed, limit, c.margin, c.slope)
        self._settings = sync_write_packet(ax12.SETTINGS, settings)

    def step(self, t: float) -> HandState | None:
        """Exchange what there is to exchange at `t` [s]; return a report when one is complete, every 10 ms.

        Raises:
            HandFault: a servo does not answer for 50 ms, reports an error, or the port is gone.
        """
        self._started = t if math.isnan(self._started) else self._started
        try:
            self._exchange(t)
        except PortError as error:
            self.close()
            self._gone, self._retry, self._asked = str(error), t + REOPEN, None
        if self._gone:
            raise HandFault(self._gone)
        for finger in self._fingers:
            if t - max(finger.heard, self._started) > LOST:
                raise HandFault(f"Servo {finger.config.id} on {self.config.port} does not answer.")
            if finger.trouble:
                raise HandFault(f"Servo {finger.config.id} on {self.config.port}: {finger.trouble}.")
        return self._report(t)

    def close(self) -> None:
        """Close the port; the servos keep what they were told."""
        if self._port is not None:
            self._port.close()
            self._port = None

    def _report(self, t: float) -> HandState | None:
        a, b = self._fingers
        # Both were read since the report before, and a tick of the clock may be a hair early.
        new = min(a.heard, b.heard) > self._reported and t - self._reported > PERIOD - 1e-6
        if not new or a.state is None or b.state is None:
            return None
        self._reported = t
        fingers = np.array([a.pad(a.state), b.pad(b.state)])
        return HandState(t, float(fingers.sum()), fingers, np.array([a.force(a.state), b.force(b.state)]))

    def _exchange(self, t: float) -> None:
        if self._port is None:
            if t < self._retry:
                return
            self._port, self._gone, self._started = self._connect(self.config.port, ax12.BAUD), "", t
        for packet in self._parser.feed(self._port.read()):
            self._answer(packet, t)
        if self._asked is not None and t - self._asked[2] > ANSWER:
            self.lost += 1
            self._asked = None
            self._parser.clear()
        if self._asked is None:
            self._ask(self._port, t)

    def _ask(self, port: SerialPort, t: float) -> None:
        finger = self._fingers[self._turn]
        # Each question asks for another number of bytes, so that the answer to an earlier one is known as such.
        self._size = (self._size + 1) % (ax12.MAX_READ - ax12.STATE_SIZE + 1)
        size = ax12.STATE_SIZE + self._size
        settings = self._settings if self._turn == 0 else b""
        port.write(settings + read_packet(finger.config.id, ax12.STATE, size))
        self._asked, self._turn = (finger, size, t), 1 - self._turn

    def _answer(self, packet: StatusPacket, t: float) -> None:
        finger, size, _ = self._asked or (None, 0, 0.0)
        if finger is None or packet.id != finger.config.id or len(packet.parameters) != size:
            self.strays += 1
            return
        self._asked = None
        if packet.error & CHECKSUM_ERROR:
            self.lost += 1
            return
        try:
            finger.state = ax12.decode(packet.parameters)
        except ValueError as error:
            finger.trouble = f"reports nonsense ({error})"
            return
        finger.trouble, finger.heard = packet.trouble, t


def _ticks(angle: float) -> int:
    """Return the position at an angle [degrees], within the servo's range."""
    return round(min(max(angle, 0.0), ax12.RANGE) * ax12.TICKS / ax12.RANGE)
