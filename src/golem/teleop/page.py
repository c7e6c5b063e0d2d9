"""The pilot's page: keyboard, gamepad and tracked hands, over a web socket of their own beside the live view."""

from __future__ import annotations

import itertools
import json
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from importlib.resources import files
from typing import Any

from golem.errors import ConfigError, MissingExtra
from golem.middleware.web_gate import LOCAL, TokenGate, is_loopback
from golem.teleop.pilot import BadMessage, HandPilot

MOST, WINDOWS = 4096, 16
"""Bytes of a message, and windows at once."""


class PilotPage:
    """Serves the page at `url`, and hears its windows."""

    def __init__(self, pilot: HandPilot, host: str, port: int, view: str, status: Callable[[], dict[str, Any]]) -> None:
        """Serve at `host` and `port`, with the live view at `view` in it, and tell windows the `status`.

        Raises:
            ConfigError: the address cannot be had.
            MissingExtra: the extra `view` is not installed.
        """
        try:
            from websockets.datastructures import Headers
            from websockets.exceptions import ConnectionClosed
            from websockets.http11 import Response
            from websockets.sync.server import serve
        except ModuleNotFoundError as error:
            raise MissingExtra(error.name or "websockets", "view") from error
        self._pilot, self._status, self._numbers = pilot, status, itertools.count(1)
        self._room, self._gone = threading.BoundedSemaphore(WINDOWS), (ConnectionClosed, OSError)
        body = (files("golem.teleop") / "pilot.html").read_text(encoding="utf-8").replace("%VIEW%", view).encode()
        headers = Headers({"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(body))})

        def page(connection: Any, request: Any) -> Any:
            asks = request.headers.get("Upgrade", "").lower() == "websocket"
            return None if asks else Response(200, "OK", headers, body)

        local = is_loopback(host)
        try:
            self._server = serve(
                self._serve, host if local else "127.0.0.1", port if local else 0, origins=[LOCAL, None],
                process_request=page, max_size=MOST, compression=None, ping_interval=1.0, ping_timeout=1.0,
            )  # fmt: skip
        except (OSError, OverflowError) as error:
            raise ConfigError(f"Cannot serve the page at {host}:{port} ({error}); choose another port.") from error
        inside = int(self._server.socket.getsockname()[1])
        self._gate = None if local else TokenGate(host, port, inside)
        self.url = f"http://{host}:{inside}/"
        if self._gate is not None:
            self.url = f"http://{host}:{self._gate.port}/?token={self._gate.token}"
        threading.Thread(target=self._server.serve_forever, name="pilot's page", daemon=True).start()

    def _serve(self, connection: Any) -> None:
        """Hear one window until it is gone."""
        if not self._room.acquire(blocking=False):
            connection.close(1013, "There are too many windows.")
            return
        who = f"window {next(self._numbers)}"
        try:
            with suppress(*self._gone):
                while True:
                    raw, error = connection.recv(), ""
                    try:
                        self._pilot.hear(who, json.loads(raw, parse_constant=_no_constant), time.monotonic())
                    except (BadMessage, ValueError, RecursionError) as wrong:
                        self._pilot.leave(who)
                        error = str(wrong) or "That is no JSON."
                    told = {"you": who, "pilot": self._pilot.state, "error": error, **self._status()}
                    connection.send(json.dumps(told))
        finally:
            self._pilot.leave(who)
            self._room.release()

    def close(self) -> None:
        """Stop serving."""
        if self._gate is not None:
            self._gate.close()
        self._server.shutdown()


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no number.")
