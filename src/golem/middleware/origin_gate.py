"""Lets no page of a stranger to a server of this process that listens on the loopback.

A browser lets any page open a web socket to this machine, and says in `Origin` whose page it is. Programs name none.
"""

from __future__ import annotations

import re
import secrets
import sys
from collections.abc import Sequence

from golem.middleware.relay import Relay

LOCAL = re.compile(r"https?://(localhost|127\.\d+\.\d+\.\d+|\[::1\])(:\d+)?")
"""Origins of pages of this machine, whatever port they came from: its users are trusted."""


class OriginGate(Relay):
    """Relays connections of programs, of pages of this machine, and of the pages that are named."""

    refusal = "This server answers pages of this machine only."

    def __init__(self, host: str, port: int, server: tuple[str, int], also: Sequence[str] = ()) -> None:
        """Listen at `host` and `port` for the server at `server`; `also` are further origins; see `Relay`."""
        self._also = frozenset(also)
        super().__init__(host, port, server)

    def admits(self, head: bytes) -> bool:
        """Return whether every origin that the head of a request names is a trusted one."""
        origins = re.findall(r"^origin:[ \t]*(.*?)[ \t]*\r?$", head.decode("latin-1"), re.I | re.M)
        return all(origin in self._also or LOCAL.fullmatch(origin) for origin in origins)


def hidden_loopback() -> str:
    """Return an address of this machine that no page guesses, for a server behind a relay.

    On Linux all of 127.0.0.0/8 is this machine; elsewhere only its first address is, and a page may find the port.
    """
    if not sys.platform.startswith("linux"):
        return "127.0.0.1"
    return f"127.{1 + secrets.randbelow(254)}.{secrets.randbelow(256)}.{1 + secrets.randbelow(254)}"
