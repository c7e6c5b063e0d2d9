"""A page of a stranger does not get to a server of this machine; programs and pages of this machine do."""

from __future__ import annotations

import http.server
import socket
import threading
from collections.abc import Iterator

import pytest

from golem.errors import ConfigError
from golem.middleware.web_gate import OriginGate, hidden_loopback, is_loopback


class Hello(http.server.BaseHTTPRequestHandler):
    """A server that greets."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b"hello")

    def log_message(self, format: str, *args: object) -> None:
        return


@pytest.fixture
def gate() -> Iterator[OriginGate]:
    server = http.server.ThreadingHTTPServer((hidden_loopback(), 0), Hello)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    host, port = server.server_address[:2]
    gate = OriginGate("127.0.0.1", 0, (str(host), port), ("https://viewer.example",))
    yield gate
    gate.close()
    server.shutdown()
    server.server_close()


def ask(gate: OriginGate, *headers: str) -> str:
    with socket.create_connection(("127.0.0.1", gate.port), 5.0) as connection:
        lines = ["GET / HTTP/1.1", "Host: x", *headers, "Connection: close", "", ""]
        connection.sendall("\r\n".join(lines).encode())
        data = b""
        while more := connection.recv(4096):
            data += more
    return data.decode()


@pytest.mark.parametrize(
    "headers",
    [
        (),
        ("Origin: http://localhost:8080",),
        ("origin: http://127.0.0.1",),
        ("Origin: http://[::1]:3000",),
        ("Origin: https://viewer.example",),
    ],
)
def test_programs_and_trusted_pages_get_through(gate: OriginGate, headers: tuple[str, ...]) -> None:
    assert ask(gate, *headers).endswith("hello")


@pytest.mark.parametrize(
    "headers",
    [
        ("Origin: https://stranger.example",),
        ("Origin: null",),
        ("Origin:",),
        ("Origin: http://localhost.stranger.example",),
        ("Origin: http://localhost", "Origin: https://stranger.example"),
        ("ORIGIN:https://stranger.example",),
        ("Origin: https://viewer.example.stranger.example",),
    ],
)
def test_pages_of_strangers_do_not(gate: OriginGate, headers: tuple[str, ...]) -> None:
    answer = ask(gate, *headers)
    assert answer.startswith("HTTP/1.1 403") and "hello" not in answer


def test_the_server_behind_is_on_this_machine_alone_and_elsewhere_each_time() -> None:
    hosts = {hidden_loopback() for _ in range(8)}
    assert all(is_loopback(host) for host in hosts) and len(hosts) > 1


def test_a_taken_port_is_said(gate: OriginGate) -> None:
    with pytest.raises(ConfigError, match="choose another port or host"):
        OriginGate("127.0.0.1", gate.port, ("127.0.0.1", 1))
