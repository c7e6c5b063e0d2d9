"""The pilot's page: keyboard, gamepad and tracked hands, over a web socket of their own beside the live view."""

from __future__ import annotations

import itertools
import json
import threading
import time
from collections.abc import Callable
from importlib.resources import files
from typing import Any

from golem.dashboard.server import LOCAL
from golem.errors import ConfigError, MissingExtra
from golem.middleware.web_gate import TokenGate, is_loopback
from golem.teleop.pilot import BadMessage, HandPilot

MOST = 4096
"""Bytes of a message."""
WINDOWS = 16
"""Windows at once."""


class PilotPage:
    """Serves the page, and hears its windows.

    Attributes:
        url: where to open it.
    """

    def __init__(self, pilot: HandPilot, host: str, port: int, view: str, status: Callable[[], dict[str, Any]]) -> None:
        """Serve at `host` and `port`, with the live view at `view` in it, and tell windows the `status`.

        Raises:
            ConfigError: the address cannot be had.
            MissingExtra: the extra `view` is not installed.
        """
        try:
            from websockets.datastructures import Headers
            from websockets.http11 import Response
            from websockets.sync.server import serve
        except ModuleNotFoundError as error:
            raise MissingExtra(error.name or "websockets", "view") from error
        self._pilot, self._status, self._numbers = pilot, status, itertools.count(1)
        self._room = threading.BoundedSemaphore(WINDOWS)
        body = (files("golem.teleop") / "pilot.html").read_text(encoding="utf-8").replace("%VIEW%", view).encode()
        headers = Headers({"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(body))})

        def page(connection: Any, request: Any) -> Any:
            if request.headers.get("Upgrade", "").lower() == "websocket":
                return None
            return Response(200, "OK", headers, body)

        local = is_loopback(host)
        try:
            self._server = serve(
                self._serve, host if local else "127.0.0.1", port if local else 0, origins=[LOCAL, None],
                process_request=page, max_size=MOST, compression=None, ping_interval=1.0, ping_timeout=1.0,
            )  # fmt: skip
        except (OSError, OverflowError) as error:
            raise ConfigError(
                f"Cannot serve the pilot's page at {host}:{port} ({error}); choose another port."
            ) from error
        inside = int(self._server.socket.getsockname()[1])
        self._gate = None if local else TokenGate(host, port, inside)
        self.url = f"http://{host}:{inside}/"
        if self._gate is not None:
            self.url = f"http://{host}:{self._gate.port}/?token={self._gate.token}"
        threading.Thread(target=self._server.serve_forever, name="pilot's page", daemon=True).start()

    def _serve(self, connection: Any) -> None:
        """Hear one window until it is gone."""
        from websockets.exceptions import ConnectionClosed

        if not self._room.acquire(blocking=False):
            connection.close(1013, "There are too many windows.")
            return
        who = f"window {next(self._numbers)}"
        try:
            while True:
                raw = connection.recv()
                error = ""
                try:
                    self._pilot.hear(who, json.loads(raw, parse_constant=_no_constant), time.monotonic())
                except (BadMessage, ValueError, RecursionError) as wrong:
                    self._pilot.leave(who)
                    error = str(wrong) or "That is no JSON."
                state = self._pilot.state
                connection.send(json.dumps({"you": who, "pilot": state, "error": error, **self._status()}))
        except (ConnectionClosed, OSError):
            pass
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
