"""Gates before a server of this process: for those who know its token, and for pages of its own.

Neither the live view's server nor Foxglove's asks who connects. So on any address but the loopback's they listen behind
this relay. The token is in the address that is printed, `?token=...`; a browser gets it back as a cookie, for its
further connections. It keeps strangers out; it does not encrypt, so whoever can listen on the network can read it: a
tunnel is the remedy.

On the loopback a browser lets any page open a web socket to this machine, and says in `Origin` whose page it is.
Programs name none.
"""

from __future__ import annotations

import errno
import hmac
import ipaddress
import re
import secrets
import selectors
import socket
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from golem.errors import ConfigError

HEAD = 16_384
"""Bytes of a request's head that are read at most."""
PATIENCE = 5.0
"""How long a whole head may take to come [s]."""
PENDING = 64
"""Connections whose heads are waited for at once; a further one ends the oldest."""


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens at `host` and `port`, 0 for a free one. Raises ConfigError: it cannot be had."""
    try:
        return socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except (OSError, OverflowError) as error:
        raise ConfigError(f"Cannot listen on {host}:{port} ({error}); choose another port or host.") from error


class Relay(ABC):
    """Relays connections to a server on this machine, those whose first request it admits."""

    refusal = ""
    """What whoever is not admitted is told."""

    def __init__(self, host: str, port: int, server: tuple[str, int]) -> None:
        """Listen at `host` and `port` (0: a free one) for a server of this machine. Raises ConfigError: it is taken."""
        self._server, self._listener = server, listen(host, port)
        self.port = int(self._listener.getsockname()[1])
        self._open: set[socket.socket] = set()
        self._lock = threading.Lock()
        threading.Thread(target=self._accept, name="relay", daemon=True).start()

    @abstractmethod
    def admits(self, head: bytes) -> bool:
        """Return whether the request that begins with `head` is relayed."""

    def greeting(self, head: bytes) -> bytes:
        """Return lines that are added to the head of the first answer to `head`."""
        return b""

    def close(self) -> None:
        """Stop listening, and end every connection."""
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        with self._lock:
            for connection in self._open:
                with suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        """Read the heads of all connections in one thread: who sends slowly, or nothing, costs the others nothing."""
        waiting = _Waiting(self._listener)
        while True:
            for connection in waiting.ready():
                try:
                    whole = waiting.read(connection)
                except OSError:  # of the listener: it is closed
                    waiting.close()
                    return
                if whole is not None:
                    threading.Thread(target=self._serve, args=(connection, whole), daemon=True).start()

    def _serve(self, outer: socket.socket, head: bytes) -> None:
        with outer, suppress(OSError):
            outer.settimeout(PATIENCE)
            if not self.admits(head):
                outer.sendall(_REFUSED + self.refusal.encode() + b"\n")
                return
            outer.settimeout(None)
            with socket.create_connection(self._server) as inner, self._held(outer, inner):
                # Where the page came from has been judged. The server itself answers this machine's pages only.
                inner.sendall(re.sub(rb"(?im)^origin[ \t]*:[^\r\n]*", b"Origin: http://127.0.0.1", head))
                back = threading.Thread(target=_pump, args=(outer, inner), daemon=True)
                back.start()
                greeting = self.greeting(head)
                if greeting:
                    first, end, rest = _head(inner).partition(b"\r\n")
                    outer.sendall(first + end + (greeting if end else b"") + rest)
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


_PASSING = (errno.EMFILE, errno.ENFILE, errno.ECONNABORTED)


class _Waiting:
    """Connections whose heads have not come whole, in the order in which they were made, and the listener."""

    def __init__(self, listener: socket.socket) -> None:
        self._listener = listener
        self._selector = selectors.DefaultSelector()
        self._selector.register(listener, selectors.EVENT_READ)
        self._heads: dict[socket.socket, bytes] = {}
        self._until: dict[socket.socket, float] = {}

    def ready(self) -> list[socket.socket]:
        """Wait for news; end what has taken too long, and return what can be read."""
        found = self._selector.select(0.2 if self._heads else None)
        now = time.monotonic()
        for late in [each for each, until in self._until.items() if until < now]:
            self._leave(late)
            late.close()
        return [key.fileobj for key, _ in found if isinstance(key.fileobj, socket.socket) and key.fileobj.fileno() >= 0]

    def read(self, connection: socket.socket) -> bytes | None:
        """Read on, or take a new connection; return the head once it is whole. Raises OSError: no listener."""
        if connection is self._listener:
            try:
                new, _ = self._listener.accept()
            except OSError as error:
                if error.errno in _PASSING:
                    time.sleep(0.05)
                    return None
                raise
            new.setblocking(False)
            self._selector.register(new, selectors.EVENT_READ)
            self._heads[new], self._until[new] = b"", time.monotonic() + PATIENCE
            if len(self._heads) > PENDING:
                oldest = next(iter(self._heads))
                self._leave(oldest)
                oldest.close()
            return None
        if connection not in self._heads:  # ended meanwhile
            return None
        try:
            more = connection.recv(4096)
        except BlockingIOError:
            return None
        except OSError:
            more = b""
        self._heads[connection] += more
        head = self._heads[connection]
        if more and b"\r\n\r\n" not in head and len(head) < HEAD:
            return None
        self._leave(connection)
        return head

    def close(self) -> None:
        for connection in self._heads:
            connection.close()
        self._selector.close()

    def _leave(self, connection: socket.socket) -> None:
        self._selector.unregister(connection)
        del self._heads[connection], self._until[connection]


_REFUSED = b"HTTP/1.1 403 Forbidden\r\nContent-Type: text/plain\r\nConnection: close\r\n\r\n"


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
    """Relays connections to a server on this machine once they have shown the token."""

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
        found = re.search(rb"[?&]token=([^&\s]*)", head.partition(b"\r\n")[0])
        return found is not None and hmac.compare_digest(found[1], self.token.encode())
