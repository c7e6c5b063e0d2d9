"""The pilot's page through its socket, as a browser's window and as a stranger's."""

from __future__ import annotations

import json
import time
import urllib.request
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from golem.errors import ConfigError
from golem.teleop.pilot import HandPilot
from golem.teleop.session import MOST, PilotPage

client = pytest.importorskip("websockets.sync.client")
HOLD = json.dumps({"hold": True, "twist": [1, 0, 0]})


@pytest.fixture
def pilot() -> HandPilot:
    return HandPilot()


@pytest.fixture
def page(pilot: HandPilot) -> Iterator[PilotPage]:
    page = PilotPage(pilot, "127.0.0.1", 0, "http://127.0.0.1:1", lambda: {"t": 1.0})
    yield page
    page.close()


def window(page: PilotPage, origin: str | None = None) -> Any:
    return client.connect(page.url.replace("http", "ws"), origin=origin, proxy=None, close_timeout=0.2)


def soon(condition: Callable[[], bool]) -> bool:
    end = time.monotonic() + 5.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    return condition()


def moves(pilot: HandPilot) -> bool:
    return pilot.wish(time.monotonic()).moves


def test_it_serves_the_page_with_the_view_in_it(page: PilotPage) -> None:
    with urllib.request.urlopen(page.url, timeout=10) as answer:
        body = answer.read()
    assert b'<iframe src="http://127.0.0.1:1"' in body and b"getGamepads" in body


def test_a_window_drives_and_is_told_so(page: PilotPage, pilot: HandPilot) -> None:
    with window(page) as socket:
        socket.send(HOLD)
        told = json.loads(socket.recv(timeout=5))
        assert moves(pilot)
        assert told["t"] == 1.0 and told["error"] == ""
        socket.send(HOLD)
        told = json.loads(socket.recv(timeout=5))
        assert told["pilot"] == told["you"]
    assert soon(lambda: not pilot._windows)
    assert not moves(pilot)


def test_a_cut_connection_lets_go(page: PilotPage, pilot: HandPilot) -> None:
    socket = window(page)
    socket.send(HOLD)
    socket.recv(timeout=5)
    socket.socket.close()  # without a word, as a tab that crashes
    assert soon(lambda: not moves(pilot))


@pytest.mark.parametrize("raw", ["", "{", "[]", '{"hold": NaN}', '{"hold": true, "twist": [1e999, 0, 0]}', b"\xff\xfe"])
def test_nonsense_is_answered_and_drives_nobody(page: PilotPage, pilot: HandPilot, raw: str | bytes) -> None:
    with window(page) as socket:
        socket.send(HOLD)
        socket.recv(timeout=5)
        socket.send(raw)
        assert json.loads(socket.recv(timeout=5))["error"]
        assert not moves(pilot)


def test_a_message_that_is_too_long_ends_its_window(page: PilotPage, pilot: HandPilot) -> None:
    with window(page) as socket:
        socket.send(" " * (MOST + 1))
        with pytest.raises(Exception, match="1009|too big|no close frame"):
            socket.recv(timeout=5)
    assert soon(lambda: not pilot._windows)


def test_pages_of_strangers_are_refused(page: PilotPage) -> None:
    with pytest.raises(Exception, match="403"):
        window(page, origin="https://example.org")
    with window(page, origin="http://localhost:1234"):
        pass


def test_a_port_that_is_taken_is_named(page: PilotPage, pilot: HandPilot) -> None:
    port = int(page.url.rsplit(":", 1)[1].strip("/"))
    with pytest.raises(ConfigError, match=str(port)):
        PilotPage(pilot, "127.0.0.1", port, "", dict)


def test_another_machine_needs_the_token(pilot: HandPilot) -> None:
    page = PilotPage(pilot, "0.0.0.0", 0, "", dict)
    try:
        bare = page.url.partition("/?")[0].replace("0.0.0.0", "127.0.0.1")
        with pytest.raises(Exception, match="403"):
            urllib.request.urlopen(bare, timeout=10)
        with urllib.request.urlopen(page.url.replace("0.0.0.0", "127.0.0.1"), timeout=10) as answer:
            assert answer.status == 200 and "golem_token" in answer.headers["Set-Cookie"]
    finally:
        page.close()
