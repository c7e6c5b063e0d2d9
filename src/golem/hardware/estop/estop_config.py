"""Which emergency stop a robot has; one is made of software, for the twin, and is pressed like the board."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

from golem.errors import ConfigError
from golem.hardware.estop.base import EmergencyStop
from golem.hardware.estop.serial_board import SerialEstop
from golem.interfaces.payloads import EstopMessage


class VirtualEstop:
    """Emits frames at a fixed rate while it is stepped; whoever stops stepping it has stopped the robot.

    Attributes:
        period: time between frames [s]; the default is the rate of the Arduino board, 100 Hz.
        pressed: state of the button.
        fault: empty: it cannot fail.
    """

    fault = ""

    def __init__(self, period: float = 0.010) -> None:
        """Start released, with the first frame due at once."""
        self.period = period
        self.pressed = False
        self._sequence = 0
        self._due = float("-inf")

    def press(self) -> None:
        """Press the button; it stays in."""
        self.pressed = True

    def release(self) -> None:
        """Pull the button out; what was stopped stays stopped until it is reset."""
        self.pressed = False

    def step(self, t: float) -> EstopMessage | None:
        """Return the frame due at `t` [s], or None between two frames."""
        # The tolerance keeps sums of a binary tick length from skipping every other period.
        if t < self._due - 1e-9:
            return None
        self._due = t + self.period
        self._sequence = (self._sequence + 1) % 256
        return EstopMessage(t, self._sequence, self.pressed)


@dataclass(frozen=True)
class EstopConfig:
    """Which emergency stop the safety gate listens to.

    Attributes:
        use: virtual (of a simulation, pressed by `golem safety press`) or serial (the board of firmware/estop).
        port: path of the board's serial port, e.g. /dev/ttyACM0.
        oldest: age up to which a frame of the board is fresh [s].
    """

    use: Literal["virtual", "serial"] = "virtual"
    port: str = ""
    oldest: float = 0.030

    def __post_init__(self) -> None:
        if (self.use == "serial") != bool(self.port):
            raise ConfigError(
                "The emergency stop 'serial' has a port, and 'virtual' has none: --estop.use serial --estop.port "
                "/dev/ttyACM0, or estop: {use: serial, port: /dev/ttyACM0} in a stack file."
            )
        if not 0.010 <= self.oldest <= 0.050:
            raise ConfigError(f"A frame of the emergency stop is fresh for 0.01 to 0.05 s, not {self.oldest:g}.")

    def words(self) -> list[str]:
        """Return what a command line says of it; nothing where it is the default."""
        values = {field.name: (getattr(self, field.name), field.default) for field in fields(self)}
        return [
            word
            for name, (value, default) in values.items()
            if value != default
            for word in (f"--estop.{name}", str(value))
        ]

    def create(self) -> EmergencyStop:
        """Build the emergency stop. Raises MissingExtra: pyserial is absent; PortError: the port cannot be opened."""
        return SerialEstop(self.port, self.oldest) if self.use == "serial" else VirtualEstop()
