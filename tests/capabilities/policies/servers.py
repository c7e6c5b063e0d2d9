"""ActionPolicy servers of OpenPI's protocol that answer as a test wants."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import msgpack
import numpy as np
from websockets.sync.server import serve

from golem.capabilities.policies.openpi import pack_array, unpack_array


def pack(value: Any) -> bytes:
    return msgpack.packb(value, default=pack_array) or b""


@contextmanager
def policy_server(answer: Callable[[dict[str, Any]], Any], hello: Any = None) -> Iterator[int]:
    """Yield the port of a server; `answer` returns the actions, bytes or words to send as they are, or raises."""

    def handle(connection: Any) -> None:
        connection.send(pack({"name": "test"}) if hello is None else hello)
        for raw in connection:
            seen = msgpack.unpackb(raw, object_hook=unpack_array, strict_map_key=False)
            said = answer(seen)
            connection.send(said if isinstance(said, bytes | str) else pack({"actions": said}))

    server = serve(handle, "127.0.0.1", 0, compression=None, max_size=2**26)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield int(server.socket.getsockname()[1])
    finally:
        server.shutdown()


def late(seconds: float) -> Callable[[dict[str, Any]], Any]:
    def answer(seen: dict[str, Any]) -> Any:
        time.sleep(seconds)
        return np.zeros((1, 25))

    return answer
