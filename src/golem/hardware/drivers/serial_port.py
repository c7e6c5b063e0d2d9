"""A serial port that never waits, so that a device which hangs holds up nobody."""

from __future__ import annotations

import errno
import os
import select
import termios
from contextlib import suppress

from golem.errors import GolemError, needs

CHUNK = 4096
"""Most bytes taken at once: what the operating system keeps for a port."""


class PortError(GolemError):
    """A serial port that cannot be opened, or that is gone."""


class SerialPort:
    """An open serial port, for this process alone; `name` is its path, e.g. /dev/ttyACM0."""

    def __init__(self, name: str, baud: int) -> None:
        """Open the port called `name` at `baud` [1/s], 8 data bits, no parity, 1 stop bit; drop what it had received.

        Raises:
            MissingExtra: pyserial is absent.
            PortError: it cannot be opened, or another process has it.
        """
        with needs("pyserial", "hardware"):
            import serial
        self.name = name
        try:
            self._port = serial.Serial(name, baud, timeout=0, write_timeout=0, exclusive=True)
        except (OSError, ValueError, termios.error) as error:
            raise PortError(f"The serial port '{name}' cannot be opened: {_reason(error)}. {_remedy(error)}") from error

    def read(self) -> bytes:
        """Return what has come, b"" if nothing has. Raises PortError: the port is gone."""
        # Not by pyserial: to write without waiting, it asks a full buffer again and again for ever.
        try:
            file = self._port.fileno()
            if not select.select([file], [], [], 0)[0]:
                return b""
            data = os.read(file, CHUNK)
        except BlockingIOError:
            return b""
        except (OSError, ValueError) as error:
            raise self._gone(error) from error
        if not data:  # readable, and yet empty: how an unplugged device reads
            raise self._gone("the device was unplugged")
        return data

    def write(self, data: bytes) -> None:
        """Send `data`; what finds no room is lost. Raises PortError: the port is gone."""
        try:
            os.write(self._port.fileno(), data)
        except BlockingIOError:
            return
        except (OSError, ValueError) as error:
            raise self._gone(error) from error

    def close(self) -> None:
        """Close the port; what has not been sent yet is dropped."""
        # Else the operating system waits half a minute for a device that takes nothing.
        with suppress(OSError, termios.error):
            termios.tcflush(self._port.fileno(), termios.TCOFLUSH)
        self._port.close()

    def _gone(self, why: object) -> PortError:
        return PortError(f"The serial port '{self.name}' is gone: {why}.")


def _reason(error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number == errno.EAGAIN:
        return "another process has it, or another device of this one"
    return os.strerror(number) if number else str(error)


def _remedy(error: Exception) -> str:
    if getattr(error, "errno", None) == errno.EACCES:
        return "Join the group that may, mostly 'dialout': sudo usermod -aG dialout $USER, then log in again."
    from serial.tools import list_ports

    ports = sorted(port.device for port in list_ports.comports())
    return f"This machine has {', '.join(ports) or 'no serial port'}."
