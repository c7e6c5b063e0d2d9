"""Driver of one MAGPIE hand: two AX-12A on a serial bus, told a gap and a force, reporting gap and forces.

The servos hold the force by themselves: their torque limit is its ceiling, as in the twin. A closing finger is sent
beyond its stop by as much as the servo is soft, so that both press with their full force wherever the part stands.

Each answer also holds goal, speed and torque limit. What a servo forgot without power is so written again: it would
else come back with its full torque and speed. One that shut itself down, after an overload or too hot, has set its
torque limit to 0, and writing would revive it: it is left alone until it is told another gap, or its power was off.
What was not read is no report: a hand that does not answer raises.

Registers and units are those of the ROBOTIS e-manual, AX-12A. The force law, load of an AX-12A <-> force of one finger,
was measured by the lab (its driver magpie_control), F in N, L the load or torque limit, 0 to 1023:

    F = 0.0025 L - 7e-7 L^2                          for L < 100
    F = -1.889e-5 L^2 + 0.038399 L - 3.4073          from there on

The second parabola has its top, 16.1 N, at L = 1016; from there on F stays at it, so that the law is monotone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from golem.errors import ConfigError, GolemError
from golem.hardware.drivers.dynamixel import (
    CHECKSUM_ERROR,
    LAST_ID,
    StatusPacket,
    StatusParser,
    read_packet,
    sync_write_packet,
)
from golem.hardware.drivers.serial_port import PortError, SerialPort
from golem.options import require
from golem.robots.model import magpie_model
from golem.robots.model.magpie_model import MAX_FORCE
from golem.types import HandCommand, HandState

KNEE = 100
"""Load at which one law gives way to the other."""
_A, _B, _C = -1.889e-5, 0.038399, -3.4073
_TOP = -_B / (2.0 * _A)
_LOW_A, _LOW_B = -7e-7, 0.0025


def force_from_load(load: float) -> float:
    """Return the force of one finger [N] at a load of 0 to 1023; no less for more load, and at most `MAX_FORCE`."""
    if load < KNEE:
        return (_LOW_A * load + _LOW_B) * load
    load = min(load, _TOP)
    return min((_A * load + _B) * load + _C, MAX_FORCE)


def load_from_force(force: float) -> int:
    """Return the torque limit, 0 to 1023, whose force is nearest to `force` [N], 0 to `MAX_FORCE`."""
    if force < force_from_load(KNEE):
        exact = (-_LOW_B + math.sqrt(_LOW_B**2 + 4.0 * _LOW_A * force)) / (2.0 * _LOW_A)
    else:
        exact = (-_B + math.sqrt(max(_B**2 - 4.0 * _A * (_C - force), 0.0))) / (2.0 * _A)
    below = math.floor(exact)
    return min((below, below + 1), key=lambda load: abs(force_from_load(load) - force))


BAUD = 1_000_000
"""Factory setting [1/s]."""
TICKS = 1023
"""Largest position; also the largest load and torque limit."""
RANGE = 300.0
"""Angle that `TICKS` stands for [degrees]."""

SETTINGS = 24
"""Address of what `settings` writes: torque enable to torque limit."""
TOLD = 30
"""Address of what is read: goal position, speed and torque limit, then what `decode` takes, from address 36."""
TOLD_SIZE = 6
STATE_SIZE = 8
"""Bytes of either: present position to present temperature."""
MAX_READ = 20
"""Bytes from `TOLD` to the end of the table."""


@dataclass(frozen=True, slots=True)
class Ax12State:
    """What a servo reports.

    Attributes:
        position: 0 to 1023, over `RANGE` degrees, counter-clockwise.
        speed: 0 to 1023; counter-clockwise positive.
        load: share of the largest torque that it applies, -1023 to 1023; counter-clockwise positive. 0 is no load:
            where nothing was read there is no `Ax12State`.
        voltage: [V].
        temperature: [degrees C].
    """

    position: int
    speed: int
    load: int
    voltage: float
    temperature: float


def decode(data: bytes) -> Ax12State:
    """Return what `STATE_SIZE` bytes from present position on say. Raises ValueError: what no AX-12A reports."""
    if len(data) < STATE_SIZE:
        raise ValueError(f"{len(data)} bytes instead of {STATE_SIZE}")
    position, speed, load = (int.from_bytes(data[i : i + 2], "little") for i in (0, 2, 4))
    if position > TICKS or speed > 2 * TICKS + 1 or load > 2 * TICKS + 1:
        raise ValueError(f"position {position}, speed {speed}, load {load}")
    return Ax12State(position, _signed(speed), _signed(load), 0.1 * data[6], float(data[7]))


def servo_settings(goal: int, speed: int, limit: int, margin: int, slope: int) -> bytes:
    """Return what is written from `SETTINGS`: all that a servo forgets when its power fails, so that none of it is old.

    Args:
        goal: position to go to, 0 to 1023.
        speed: at most, 1 to 1023; 1023 is 114 rpm. 0, which is no limit, is refused.
        limit: torque limit, 0 to 1023.
        margin: positions on either side of the goal without torque, 0 to 255.
        slope: how soft it is around the goal, 2 to 128.

    Raises:
        ValueError: a number is out of range.
    """
    if not (0 <= goal <= TICKS and 1 <= speed <= TICKS and 0 <= limit <= TICKS):
        raise ValueError(f"goal {goal}, speed {speed}, torque limit {limit}")
    words = b"".join(value.to_bytes(2, "little") for value in (goal, speed, limit))
    return bytes((1, 0, margin, margin, slope, slope)) + words


def _signed(value: int) -> int:
    """Return a number whose bit 10 says that it is clockwise."""
    return -(value & TICKS) if value & (TICKS + 1) else value & TICKS


PERIOD = 0.010
"""Time between two reports [s]."""
ANSWER = 0.005
"""Time in which a servo answers [s]: on the wire 0.7 ms, the rest is for the adapter and the operating system."""
LOST = 0.050
"""Time without an answer from which a servo is lost [s]: eight questions."""
SHUTDOWN = 0x24
"""Error bits after which an AX-12A takes its torque away, as it comes (Alarm Shutdown 36): overheated, overload."""
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
        a, b = self.a.id, self.b.id
        bounds = [("id", a, 0, LAST_ID), ("id", b, 0, LAST_ID), ("speed", self.speed, 1, TICKS)]
        bounds += [("margin", self.margin, 0, 255), ("slope", self.slope, 2, 128)]
        for name, x, least, most in bounds:
            require("", (f"{name} of a hand's servo", x, least <= x <= most, f"{least} to {most}"))
        if {abs(self.a.closes), abs(self.b.closes)} != {1}:
            raise ConfigError("A finger closes by turning counter-clockwise, 1, or clockwise, -1.")


class _Finger:
    def __init__(self, config: FingerConfig) -> None:
        self.config = config
        self.state: Ax12State | None = None
        self.heard = -math.inf
        self.trouble = ""
        self.settings = b""
        self.due = self.shut = self._taken = False

    def tell(self, settings: bytes) -> None:
        """Take what it is told; another goal than before ends a shutdown."""
        if settings[6:8] != self.settings[6:8]:
            self.shut, self._taken = False, False
        self.due |= settings != self.settings
        self.settings = settings

    def heed(self, packet: StatusPacket) -> None:
        """Take the errors of an answer, and what the servo says that it was told."""
        told, own = packet.parameters[:TOLD_SIZE], self.settings[6:]
        limp = not any(told[4:6])
        # Its error stays until it is written to: before it has taken a new goal it says nothing of that one.
        down = self._taken and (limp or bool(packet.error & SHUTDOWN))
        if down or not limp:  # one that has torque, and says nothing of an error, was without power
            self.shut = down
        self._taken |= told == own
        self.due |= told != own != b"" and (not limp or (any(told) and not self._taken))
        if not self.shut:
            self.trouble = packet.trouble
        elif packet.trouble or not self.trouble:
            self.trouble = packet.trouble or "it has taken its torque away"

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

    def pad(self, state: Ax12State) -> float:
        """Return the distance of the pad from the hand's centre plane [m]."""
        c = self.config
        angle = c.closes * (state.position * RANGE / TICKS - c.upright)
        return float(magpie_model.pad_offset(math.radians(angle) + 0.5 * math.pi - magpie_model.ANGLE_OPEN))

    def force(self, state: Ax12State) -> float:
        """Return the force with which the pad presses [N]; 0 for a load that opens."""
        return force_from_load(max(self.config.closes * state.load, 0))


class MagpieServos:
    """Speaks to the servos of one hand. Never waits: it has to be stepped every 2 ms or so.

    Attributes:
        parser: finds answers among what has come; it counts what was none.
        lost: questions without an answer in time.
        strays: answers to no question, among them those that came too late.
    """

    def __init__(self, config: MagpieServoConfig, connect: Callable[[str, int], SerialPort] = SerialPort) -> None:
        """Open the bus; nothing moves before the first command. `connect`: opens a port by name and baud rate.

        Raises:
            MissingExtra: pyserial is absent.
            PortError: the port cannot be opened.
        """
        self.config = config
        self.lost = self.strays = 0
        self._connect = connect
        self._port: SerialPort | None = connect(config.port, BAUD)
        self.parser = StatusParser()
        self._fingers = (_Finger(config.a), _Finger(config.b))
        self._asked: tuple[_Finger, int, float] | None = None
        self._turn = self._size = 0
        self._reported = self._retry = -math.inf
        self._started = math.nan
        self._gone = ""

    def command(self, command: HandCommand) -> None:
        """Take what the hand is told, as far as it can do it. Raises ValueError: a number is not finite."""
        if not (math.isfinite(command.gap) and math.isfinite(command.force)):
            raise ValueError(f"A hand is told finite numbers, not {command}.")
        force = min(max(command.force, magpie_model.MIN_FORCE), magpie_model.MAX_FORCE)
        c, limit = self.config, load_from_force(force)
        for finger in self._fingers:
            goal = finger.goal(command.gap) if command.gap > 0.0 else finger.closed(c.slope)
            finger.tell(servo_settings(goal, c.speed, limit, c.margin, c.slope))

    def step(self, t: float) -> HandState | None:
        """Exchange what there is to exchange at `t` [s]; return a report when one is complete, every 10 ms.

        Raises HandFault: a servo does not answer for 50 ms, reports an error, or the port is gone.
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
            self._port, self._gone, self._started = self._connect(self.config.port, BAUD), "", t
        for packet in self.parser.feed(self._port.read()):
            self._answer(packet, t)
        if self._asked is not None and t - self._asked[2] > ANSWER:
            self.lost += 1
            self._asked = None
            self.parser.clear()
        if self._asked is None:
            self._ask(self._port, t)

    def _ask(self, port: SerialPort, t: float) -> None:
        finger = self._fingers[self._turn]
        # Each question asks for another number of bytes, so that the answer to an earlier one is known as such.
        self._size = (self._size + 1) % (MAX_READ - TOLD_SIZE - STATE_SIZE + 1)
        size = TOLD_SIZE + STATE_SIZE + self._size
        due = [f for f in self._fingers if f.due and not f.shut] if self._turn == 0 else []
        settings = sync_write_packet(SETTINGS, {f.config.id: f.settings for f in due}) if due else b""
        for f in due:
            f.due = False
        port.write(settings + read_packet(finger.config.id, TOLD, size))
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
            finger.state = decode(packet.parameters[TOLD_SIZE:])
        except ValueError as error:
            finger.trouble = f"reports nonsense ({error})"
            return
        finger.heed(packet)
        finger.heard = t


def _ticks(angle: float) -> int:
    """Return the position at an angle [degrees], within the servo's range."""
    return round(min(max(angle, 0.0), RANGE) * TICKS / RANGE)
