"""Which emergency stop a robot has."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

from golem.errors import ConfigError
from golem.hardware.estop.base import EmergencyStop
from golem.hardware.estop.serial_board import SerialEstop
from golem.hardware.estop.virtual import VirtualEstop


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
                "The emergency stop 'serial' has a port, and 'virtual' has none: "
                "estop: {use: serial, port: /dev/ttyACM0}."
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
        """Build the emergency stop.

        Raises:
            MissingExtra: pyserial is absent.
            PortError: the port cannot be opened.
        """
        return SerialEstop(self.port, self.oldest) if self.use == "serial" else VirtualEstop()
