"""No page of a stranger opens a web socket to the live view."""

from __future__ import annotations

import contextlib
import io
import socket
from collections.abc import Iterator

import pytest

from golem.dashboard.server import serve


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    server = serve("127.0.0.1", 0)
    yield server.get_port()
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def answer(port: int, *headers: str) -> str:
    """Return the status line of the answer to a web socket that is to be opened."""
    key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version: 13"
    lines = ["GET / HTTP/1.1", "Host: x", "Upgrade: websocket", "Connection: Upgrade", *key, *headers, "", ""]
    with socket.create_connection(("127.0.0.1", port), 5.0) as connection:
        connection.sendall("\r\n".join(lines).encode())
        return connection.recv(4096).decode("latin-1").partition("\r\n")[0]


@pytest.mark.parametrize("origin", ["http://localhost:8080", "http://127.0.0.1:1", "https://[::1]:8080"])
def test_a_page_of_this_machine_is_let_in(port: int, origin: str) -> None:
    assert " 101 " in answer(port, f"Origin: {origin}")


def test_a_program_is_let_in(port: int) -> None:
    assert " 101 " in answer(port)


@pytest.mark.parametrize(
    "origin", ["http://stranger.example", "http://localhost.stranger.example", "http://127.0.0.1.x:80", "null"]
)
def test_a_page_of_a_stranger_is_not(port: int, origin: str) -> None:
    assert " 403 " in answer(port, f"Origin: {origin}")
