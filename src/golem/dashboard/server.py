"""The live view's server, which no page of a stranger can use.

A browser lets any page open a web socket to this machine, and says in `Origin` whose page it is. So only pages that
came from this machine are answered. A page whose name was turned to this machine's address (DNS rebinding) still
names itself.
"""

from __future__ import annotations

import contextlib
import functools
import io
import logging
import socket
from typing import TYPE_CHECKING
from unittest import mock

from golem.errors import ConfigError, MissingExtra
from golem.middleware.web_gate import LOCAL

if TYPE_CHECKING:
    import viser


def serve(host: str, port: int) -> viser.ViserServer:
    """Start a server at exactly the port that was asked for: viser would silently take the next free one.

    Web sockets are opened for pages of this machine, and for programs, which name no page.

    Raises:
        ConfigError: the address cannot be had.
        MissingExtra: viser is not installed.
    """
    try:
        import viser
        import websockets.asyncio.server
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "viser", "view") from error
    try:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
            port = probe.getsockname()[1]
    except (OSError, OverflowError) as error:
        raise ConfigError(f"Cannot serve the live view at {host}:{port} ({error}); choose another --port.") from error
    logging.getLogger("websockets").setLevel(logging.ERROR)
    strict = functools.partial(websockets.asyncio.server.serve, origins=[LOCAL, None])
    with (
        contextlib.redirect_stdout(io.StringIO()),  # its banner; our callers say where to look
        # viser has no option for it. Its constructor returns once it serves.
        mock.patch.object(websockets.asyncio.server, "serve", strict),
    ):
        return viser.ViserServer(host=host, port=port, verbose=False)
