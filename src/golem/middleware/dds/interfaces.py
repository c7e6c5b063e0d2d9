"""The network interfaces of this machine."""

from __future__ import annotations

import fcntl
import socket
import struct
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from golem.errors import unknown_name

_UP, _LOOPBACK, _MULTICAST = 0x1, 0x8, 0x1000
"""Bits of an interface's flags: IFF_UP, IFF_LOOPBACK, IFF_MULTICAST of linux/if.h."""
_GET_ADDRESS = 0x8915
"""SIOCGIFADDR of linux/sockios.h."""


@dataclass(frozen=True, slots=True)
class Interface:
    """A network interface, `loopback` if it stays on this machine, `multicast` if it can send to groups."""

    name: str
    loopback: bool
    multicast: bool

    @property
    def address(self) -> str:
        """Its first IPv4 address; empty where it has none, or where this system is not asked for it."""
        if self.loopback:
            return "127.0.0.1"
        if not sys.platform.startswith("linux"):
            return ""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket, suppress(OSError):
            request = struct.pack("256s", self.name.encode())
            return socket.inet_ntoa(fcntl.ioctl(any_socket, _GET_ADDRESS, request)[20:24])
        return ""


def interfaces() -> list[Interface]:
    """Return the interfaces that are up, in the operating system's order."""
    found = (_describe(name) for _, name in socket.if_nameindex())
    return [interface for interface in found if interface is not None]


def find_interface(name: str) -> Interface:
    """Return an interface that is up; `lo` is the loopback interface, whatever it is called here.

    Raises ConfigError: there is none of that name; the message lists those there are.
    """
    known = interfaces()
    for interface in known:
        if interface.name == name or (name == "lo" and interface.loopback):
            return interface
    raise unknown_name("network interface", name, [interface.name for interface in known])


def _describe(name: str) -> Interface | None:
    if not sys.platform.startswith("linux"):
        return Interface(name, loopback=name.startswith("lo"), multicast=True)
    flags = int(Path("/sys/class/net", name, "flags").read_text(encoding="ascii"), 16)
    return Interface(name, bool(flags & _LOOPBACK), bool(flags & _MULTICAST)) if flags & _UP else None


def receive_buffer() -> int | None:
    """Return the largest receive buffer that a program may ask for [bytes]; None where the system does not say."""
    limit = Path("/proc/sys/net/core/rmem_max")
    return int(limit.read_text(encoding="ascii")) if limit.is_file() else None
