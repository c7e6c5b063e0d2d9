"""Lets nobody from other machines to a server of this process who does not know its token.

Neither the live view's server nor Foxglove's asks who connects. So on any address but the loopback's they listen behind
this: a TCP relay that reads the head of the first HTTP request of each connection. The token is in the address that is
printed, `?token=...`; a browser gets it back as a cookie, for its further connections. It keeps strangers out; it does
not encrypt, so whoever can listen on the network can read it: a tunnel is the remedy.
"""

from __future__ import annotations

import hmac
import ipaddress
import re
import secrets
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from golem.errors import ConfigError

HEAD = 16_384
"""Bytes of a request's head that are read at most."""
PATIENCE = 5.0
"""How long a head may take to come [s]."""
COOKIE = "golem_token"
_REFUSED = (
    b"HTTP/1.1 403 Forbidden\r\nContent-Type: text/plain\r\nConnection: close\r\n\r\n"
    b"Open the address that GOLEM has printed: it ends with the token.\n"
)


def is_loopback(host: str) -> bool:
    """Return whether only this machine reaches what listens at `host`."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class TokenGate:
    """Relays connections to a server on this machine once they have shown the token.

    Attributes:
        port: on which it listens.
        token: what has to be shown.
    """

    def __init__(self, host: str, port: int, server: int) -> None:
        """Listen at `host` and `port` (0 takes a free one) for the server at the loopback's port `server`.

        Raises:
            ConfigError: the address cannot be had.
        """
        self.token = secrets.token_urlsafe(16)
        self._server = server
        try:
            self._listener = socket.create_server((host, port))
        except OSError as error:
            raise ConfigError(
                f"Cannot listen on {host}:{port} ({error}); choose another port or host."
            ) from error
        self.port = int(self._listener.getsockname()[1])
        self._open: set[socket.socket] = set()
        self._lock = threading.Lock()
        threading.Thread(target=self._accept, name="token gate", daemon=True).start()

    def close(self) -> None:
        """Stop listening, and end every connection."""
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        with self._lock:
            for connection in self._open:
                with suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)

    def admits(self, head: bytes) -> tuple[bool, bool]:
        """Return whether the head of a request shows the token, and whether it does so in its address."""
        line, _, rest = head.decode("latin-1").partition("\r\n")
        asked = re.search(r"[?&]token=([\w-]+)", line)
        kept = re.search(rf"^cookie:.*?\b{COOKIE}=([\w-]+)", rest, re.I | re.M)
        by_address = asked is not None and hmac.compare_digest(asked[1], self.token)
        return by_address or (kept is not None and hmac.compare_digest(kept[1], self.token)), by_address

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, outer: socket.socket) -> None:
        with outer, suppress(OSError):
            outer.settimeout(PATIENCE)
            head = _head(outer)
            admitted, by_address = self.admits(head)
            if not admitted:
                outer.sendall(_REFUSED)
                return
            outer.settimeout(None)
            with socket.create_connection(("127.0.0.1", self._server)) as inner, self._held(outer, inner):
                # The token has shown where the page came from. The server itself answers this machine's pages only.
                inner.sendall(re.sub(rb"(?im)^origin:[^\r\n]*", b"Origin: http://127.0.0.1", head))
                back = threading.Thread(target=_pump, args=(outer, inner), daemon=True)
                back.start()
                if by_address:
                    answer = _head(inner)
                    first, end, rest = answer.partition(b"\r\n")
                    cookie = (
                        f"Set-Cookie: {COOKIE}={self.token}; Path=/; HttpOnly; SameSite=Strict\r\n".encode()
                    )
                    outer.sendall(first + end + (cookie if end else b"") + rest)
                _pump(inner, outer)
                back.join()

    @contextmanager
    def _held(self, *sockets: socket.socket) -> Iterator[None]:
        """Keep sockets among those that `close` ends."""
        with self._lock:
            self._open.update(sockets)
        try:
            yield
        finally:
            with self._lock:
                self._open.difference_update(sockets)


def _head(connection: socket.socket) -> bytes:
    """Return what has come up to the end of a head, and what came with it."""
    head = b""
    while b"\r\n\r\n" not in head and len(head) < HEAD:
        more = connection.recv(4096)
        if not more:
            break
        head += more
    return head


def _pump(source: socket.socket, sink: socket.socket) -> None:
    """Pass on everything until `source` ends, and then say so."""
    with suppress(OSError):
        while data := source.recv(65_536):
            sink.sendall(data)
    with suppress(OSError):
        sink.shutdown(socket.SHUT_WR)
