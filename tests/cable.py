"""Two network namespaces joined by a cable that can be pulled out and put back; needs root and iproute2."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


class NoNamespaces(Exception):
    """This machine or this user makes no network namespaces."""


@dataclass(frozen=True)
class End:
    """One end of the cable.

    Attributes:
        space: the namespace it is in.
        interface: its name there.
    """

    space: str
    interface: str

    @property
    def inside(self) -> list[str]:
        """The words before a command that is to run there."""
        return ["ip", "netns", "exec", self.space]

    def plug(self, state: bool) -> None:
        """Put the cable in or pull it out."""
        _ip("-n", self.space, "link", "set", self.interface, "up" if state else "down")


@contextmanager
def cable() -> Iterator[tuple[End, End]]:
    """Give both ends of a new cable, plugged in, with the addresses 10.77.0.1 and 10.77.0.2.

    Raises:
        NoNamespaces: it cannot be made here.
    """
    if shutil.which("ip") is None:
        raise NoNamespaces("needs the program ip (iproute2)")
    number = os.getpid()
    ends = End(f"golema{number}", f"vea{number}"), End(f"golemb{number}", f"veb{number}")
    made = subprocess.run(["ip", "netns", "add", ends[0].space], capture_output=True, text=True, check=False)
    if made.returncode != 0:
        raise NoNamespaces(f"needs the right to make network namespaces: {made.stderr.strip()}")
    try:
        _ip("netns", "add", ends[1].space)
        _ip("link", "add", ends[0].interface, "type", "veth", "peer", "name", ends[1].interface)
        for i, end in enumerate(ends):
            _ip("link", "set", end.interface, "netns", end.space)
            _ip("-n", end.space, "addr", "add", f"10.77.0.{i + 1}/24", "dev", end.interface)
            _ip("-n", end.space, "link", "set", "lo", "up")
            end.plug(True)
        yield ends
    finally:
        for end in ends:
            subprocess.run(["ip", "netns", "delete", end.space], check=False, capture_output=True)


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)
