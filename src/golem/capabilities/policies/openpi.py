"""Client of a policy server that speaks OpenPI's protocol: msgpack maps over a web socket, arrays packed as bytes.

Physical-Intelligence/openpi, packages/openpi-client/src/openpi_client/{websocket_client_policy,msgpack_numpy}.py: on
connection the server sends a map about itself; then each observation, a map, is answered by a map with `actions`. An
answer that is text is the server's error. `scripts/serve_policy.py` serves a checkpoint of LeRobot's or of ours so.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from golem.errors import ConfigError, ServiceUnavailable, needs, shorten
from golem.options import require


@dataclass(frozen=True)
class PolicyLinkConfig:
    """Where the policy server is, what it is sent, and what its time costs.

    Attributes:
        host, port: address of the server.
        timeout: time that it gets for an answer [s].
        latency: declared time from an observation to its actions [s]: the robot goes on with the actions before, and
            the first of the new ones are too late.
        fps: actions of a chunk per second [Hz], as the data set was recorded.
        n_action_steps: actions of a chunk that are used before the next observation goes out.
        cameras: whose pictures it is sent.
        width: of the pictures [px]; 0 is as the camera has it.
        api_key: of the server, if it asks for one.
        file: of a policy that `golem train act` wrote, which needs no server; it says its own camera and rate.
    """

    host: str = "127.0.0.1"
    port: int = 8000
    timeout: float = 5.0
    latency: float = 0.1
    fps: int = 15
    n_action_steps: int = 8
    cameras: tuple[str, ...] = ("right_hand",)
    width: int = 0
    api_key: str = ""
    file: str = ""

    def __post_init__(self) -> None:
        require(
            "policy's ",
            ("port", self.port, 0 < self.port < 65536, "from 1 to 65535"),
            ("timeout", self.timeout, 0.0 < self.timeout <= 600.0, "from 0 to 600 s"),
            ("latency", self.latency, 0.0 <= self.latency <= 10.0, "from 0 to 10 s"),
            ("fps", self.fps, 1 <= self.fps <= 100, "from 1 to 100 Hz"),
            ("n_action_steps", self.n_action_steps, 1 <= self.n_action_steps <= 1000, "from 1 to 1000"),
            ("width", self.width, self.width == 0 or 16 <= self.width <= 4096, "0, or from 16 to 4096 px"),
        )
        if any(c in self.host for c in "/?#@ "):
            raise ConfigError(f"The policy's host is a name or an address, not '{self.host}'.")


class PolicyServer:
    """One policy server, whose words of itself are `about`; it is connected to when asked, and after a failure."""

    def __init__(self, config: PolicyLinkConfig) -> None:
        """Take the address. Raises MissingExtra: the extra `policy` is not installed."""
        _packages()
        self._config, self._socket = config, None
        self._where = f"The policy server at {config.host}:{config.port}"
        self.about: dict[str, Any] = {}

    def infer(self, observation: Mapping[str, Any]) -> Any:
        """Return the actions for an observation of arrays and words, as they came.

        Raises ServiceUnavailable: the server is not there, takes too long, refuses, or answers nonsense.
        """
        websockets, msgpack, _ = _packages()
        c, where = self._config, self._where
        try:
            socket = self._socket or self._connect()
            socket.send(msgpack.packb(dict(observation), default=pack_array))
            answer = self._read(socket.recv(timeout=c.timeout))
        except TimeoutError as error:
            self.close()
            raise ServiceUnavailable(f"{where} gave no answer within {c.timeout:g} s.") from error
        except (OSError, websockets.WebSocketException, EOFError) as error:
            self.close()
            raise ServiceUnavailable(f"{where} cannot be reached: {shorten(str(error) or repr(error))}.") from error
        if "actions" not in answer:
            raise ServiceUnavailable(f"{where} sent no 'actions', but {', '.join(map(str, answer)) or 'nothing'}.")
        return answer["actions"]

    def close(self) -> None:
        """End the connection."""
        socket, self._socket = self._socket, None
        if socket is not None:
            with suppress(Exception):
                socket.close_socket() if hasattr(socket, "close_socket") else socket.close()

    def _connect(self) -> Any:
        _, _, client = _packages()
        c = self._config
        headers = {"Authorization": f"Api-Key {c.api_key}"} if c.api_key else None
        host = f"[{c.host}]" if ":" in c.host else c.host
        socket = client.connect(
            f"ws://{host}:{c.port}", compression=None, max_size=2**26, additional_headers=headers, proxy=None,
            open_timeout=c.timeout, close_timeout=0.5,
        )  # fmt: skip
        self._socket = socket
        self.about = self._read(socket.recv(timeout=c.timeout))
        return socket

    def _read(self, raw: bytes | str) -> dict[str, Any]:
        _, msgpack, _ = _packages()
        if isinstance(raw, str):
            self.close()
            raise ServiceUnavailable(
                f"{self._where} failed: {shorten(raw.strip().splitlines()[-1] if raw.strip() else raw)}."
            )
        try:
            value = msgpack.unpackb(raw, object_hook=unpack_array, strict_map_key=False)
        except Exception as error:  # msgpack's errors have no common base
            raise ServiceUnavailable(f"{self._where} sent {len(raw)} bytes that are no msgpack.") from error
        if not isinstance(value, dict):
            raise ServiceUnavailable(f"{self._where} sent a {type(value).__name__}, not a map.")
        return value


def pack_array(value: object) -> object:
    """Return an array or a NumPy number as openpi_client.msgpack_numpy packs it."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        data = np.ascontiguousarray(value).tobytes()
        return {b"__ndarray__": True, b"data": data, b"dtype": value.dtype.str, b"shape": value.shape}
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    raise TypeError(f"a {type(value).__name__} is not sent")


def unpack_array(value: dict[Any, Any]) -> object:
    """Return what a map of openpi_client.msgpack_numpy holds, or another map as it is. Raises ValueError: damaged."""
    if b"__npgeneric__" in value:
        return np.dtype(value[b"dtype"]).type(value[b"data"])
    if b"__ndarray__" not in value:
        return value
    dtype = np.dtype(value[b"dtype"])
    if dtype.kind not in "fiub":
        raise ValueError(f"an array of {dtype}")
    return np.frombuffer(value[b"data"], dtype).reshape(value[b"shape"])


def _packages() -> tuple[Any, Any, Any]:
    with needs("", "policy"):
        import msgpack
        import websockets
        import websockets.sync.client
    return websockets, msgpack, websockets.sync.client
