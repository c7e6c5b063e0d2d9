"""Gates before a server of this process: for those who know its token, and for pages of its own.

Neither the live view's server nor Foxglove's asks who connects. So on any address but the loopback's they listen behind
this relay. The token is in the address that is printed, `?token=...`; a browser gets it back as a cookie, for its
further connections. It keeps strangers out; it does not encrypt, so whoever can listen on the network can read it: a
tunnel is the remedy.

On the loopback a browser lets any page open a web socket to this machine, and says in `Origin` whose page it is.
Programs name none.
"""

from __future__ import annotations

import hmac
import ipaddress
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
        origins = re.findall(r"^origin[ \t]*:[ \t]*(.*?)[ \t]*\r?$", head.decode("latin-1"), re.I | re.M)
        return all(origin in self._also or LOCAL.fullmatch(origin) for origin in origins)


def hidden_loopback() -> str:
    """Return an address of this machine that no page guesses, for a server behind a relay.

    On Linux all of 127.0.0.0/8 is this machine; elsewhere only its first address is, and a page may find the port.
    """
    if not sys.platform.startswith("linux"):
        return "127.0.0.1"
    return f"127.{1 + secrets.randbelow(254)}.{secrets.randbelow(256)}.{1 + secrets.randbelow(254)}"


COOKIE = "golem_token"


def is_loopback(host: str) -> bool:
    """Return whether only this machine reaches what listens at `host`."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class TokenGate(Relay):
    """Relays connections to a server on this machine once they have shown the token.

    Attributes:
        token: what has to be shown.
    """

    refusal = "Open the address that GOLEM has printed: it ends with the token."

    def __init__(self, host: str, port: int, server: int | tuple[str, int]) -> None:
        """Listen at `host` and `port` for a server, at the loopback's port `server`, or where it says; see `Relay`."""
        self.token = secrets.token_urlsafe(16)
        super().__init__(host, port, ("127.0.0.1", server) if isinstance(server, int) else server)

    def admits(self, head: bytes) -> bool:
        """Return whether the head of a request shows the token."""
        kept = re.search(
            rf"^cookie:.*?\b{COOKIE}=([A-Za-z0-9_-]+)", head.decode("latin-1").partition("\r\n")[2], re.I | re.M
        )
        return self._by_address(head) or (kept is not None and hmac.compare_digest(kept[1], self.token))

    def greeting(self, head: bytes) -> bytes:
        """Return the cookie, for who has shown the token in the address."""
        cookie = f"Set-Cookie: {COOKIE}={self.token}; Path=/; HttpOnly; SameSite=Strict\r\n"
        return cookie.encode() if self._by_address(head) else b""

    def _by_address(self, head: bytes) -> bool:
        return self._shown(re.search(rb"[?&]token=([^&\s]*)", head.partition(b"\r\n")[0]))

    def _shown(self, found: re.Match[bytes] | None) -> bool:
        return found is not None and hmac.compare_digest(found[1], self.token.encode())
