"""A serial line made of a pseudo terminal: nothing is lost, and nothing is waited for in vain."""

from __future__ import annotations

import array
import fcntl
import os
import termios
import tty
from time import monotonic, sleep

from golem.hardware.drivers.serial_port import SerialPort

PATIENCE = 5.0
"""How long the kernel may take to hand on a few bytes on a busy machine [s]."""


class CountingPort(SerialPort):
    """A port that counts the bytes that the host has read and written."""

    taken = 0
    written = 0

    def read(self) -> bytes:
        data = super().read()
        self.taken += len(data)
        return data

    def write(self, data: bytes) -> None:
        super().write(data)
        self.written += len(data)

    def arrive(self, total: int) -> None:
        """Wait until all of the `total` bytes that were ever sent to the host have been read or can be."""
        wait_for(self._port.fileno(), total - self.taken)


class PtyLine:
    """The device's end of a line.

    Attributes:
        name: path of the host's end.
    """

    def __init__(self) -> None:
        """Open both ends; the host's stays open, so that bytes may come before the host does."""
        self._device, self._host = os.openpty()
        tty.setraw(self._host)
        os.set_blocking(self._device, False)
        self.name = os.ttyname(self._host)

    def send(self, data: bytes) -> None:
        """Send to the host; they have arrived when this returns."""
        before = waiting(self._host)
        assert os.write(self._device, data) == len(data)
        wait_for(self._host, before + len(data))

    def receive(self, size: int = 0) -> bytes:
        """Return what the host has sent, once at least `size` bytes have come."""
        wait_for(self._device, size)
        try:
            return os.read(self._device, 4096)
        except BlockingIOError:
            return b""

    def unplug(self) -> None:
        """Take the device away."""
        os.close(self._host)
        os.close(self._device)
        self._device = -1

    def close(self) -> None:
        """Close both ends if they are open."""
        if self._device >= 0:
            self.unplug()


def waiting(file: int) -> int:
    """Return how many bytes can be read from `file` now."""
    count = array.array("i", [0])
    fcntl.ioctl(file, termios.FIONREAD, count)
    return count[0]


def wait_for(file: int, size: int) -> None:
    """Wait until `size` bytes can be read from `file`."""
    end = monotonic() + PATIENCE
    while waiting(file) < size:
        assert monotonic() < end, f"{waiting(file)} of {size} bytes came"
        sleep(0.0002)
