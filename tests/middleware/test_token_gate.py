"""Nobody passes without the token; who has it once gets through again by the cookie."""

from __future__ import annotations

import http.server
import re
import socket
import threading
from collections.abc import Iterator

import pytest

from golem.errors import ConfigError
from golem.middleware import web_gate
from golem.middleware.web_gate import TokenGate, is_loopback


class Hello(http.server.BaseHTTPRequestHandler):
    """A server that greets."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Length", "5")
        self.end_headers()
        self.wfile.write(b"hello")

    def log_message(self, format: str, *args: object) -> None:
        return


@pytest.fixture
def gate() -> Iterator[TokenGate]:
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Hello)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    gate = TokenGate("127.0.0.1", 0, server.server_address[1])
    yield gate
    gate.close()
    server.shutdown()
    server.server_close()


def ask(gate: TokenGate, path: str, *headers: str) -> str:
    """Return the whole answer to a request."""
    with socket.create_connection(("127.0.0.1", gate.port), 5.0) as connection:
        lines = [f"GET {path} HTTP/1.1", "Host: x", *headers, "Connection: close", "", ""]
        connection.sendall("\r\n".join(lines).encode())
        data = b""
        while more := connection.recv(4096):
            data += more
    return data.decode()


def test_the_token_opens_and_its_cookie_opens_again(gate: TokenGate) -> None:
    answer = ask(gate, f"/?token={gate.token}")
    assert answer.startswith("HTTP/1.0 200") and answer.endswith("hello")
    cookie = re.search(r"^Set-Cookie: (golem_token=[\w-]+);.*HttpOnly; SameSite=Strict\r$", answer, re.M)
    assert cookie is not None
    again = ask(gate, "/assets/x.js", f"Cookie: other=1; {cookie[1]}")
    assert again.endswith("hello") and "Set-Cookie" not in again


@pytest.mark.parametrize(
    ("path", "header"),
    [
        ("/", "X: y"),
        ("/?token=", "X: y"),
        ("/?token=wrong", "X: y"),
        ("/", "Cookie: golem_token=wrong"),
        ("/?x=1", "Referer: http://x/?token=wrong"),
    ],
)
def test_nobody_else_gets_through(gate: TokenGate, path: str, header: str) -> None:
    answer = ask(gate, path, header)
    assert answer.startswith("HTTP/1.1 403") and "hello" not in answer


def test_garbage_ends_the_connection_and_nothing_else(gate: TokenGate) -> None:
    with socket.create_connection(("127.0.0.1", gate.port), 5.0) as connection:
        try:
            connection.sendall(b"\x00\xff" * 10_000)
            answer = connection.recv(64)
        except OSError:  # it was ended before all of it was sent
            answer = b""
    assert answer == b"" or answer.startswith(b"HTTP/1.1 403")
    assert ask(gate, f"/?token={gate.token}").endswith("hello")


def test_a_token_that_is_no_ascii_is_refused_as_any_other(gate: TokenGate) -> None:
    before = threading.active_count()
    for address in ("/?token=é", f"/?token={gate.token}é", "/?token="):
        assert ask(gate, address).startswith("HTTP/1.1 403")
    assert threading.active_count() <= before + 1


def test_who_sends_slowly_takes_no_thread_and_keeps_nobody_out(
    gate: TokenGate, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = threading.active_count()
    slow = [socket.create_connection(("127.0.0.1", gate.port), 5.0) for _ in range(3 * web_gate.PENDING)]
    for connection in slow[-web_gate.PENDING :]:
        connection.sendall(b"G")
    assert ask(gate, f"/?token={gate.token}").endswith("hello")
    assert threading.active_count() <= before + 3
    slow[0].settimeout(5.0)
    assert slow[0].recv(1) == b""  # the oldest were ended
    monkeypatch.setattr(web_gate, "PATIENCE", 0.001)
    late = socket.create_connection(("127.0.0.1", gate.port), 5.0)
    assert late.recv(1) == b""
    for connection in (*slow, late):
        connection.close()


def test_a_taken_port_is_said_and_tokens_differ(gate: TokenGate) -> None:
    with pytest.raises(ConfigError, match="choose another port or host"):
        TokenGate("127.0.0.1", gate.port, 1)
    other = TokenGate("127.0.0.1", 0, 1)
    other.close()
    assert other.token != gate.token and len(gate.token) >= 20


@pytest.mark.parametrize(
    ("host", "local"),
    [("127.0.0.1", True), ("localhost", True), ("::1", True), ("0.0.0.0", False), ("192.168.1.2", False), ("x", False)],
)
def test_which_addresses_are_this_machines_alone(host: str, local: bool) -> None:
    assert is_loopback(host) is local
