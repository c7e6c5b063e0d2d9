"""Serves messages live to Foxglove and whatever else speaks its WebSocket protocol.

Schemas and payloads are those of a bag (`ros2msg`, CDR): nothing is converted for the viewers.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from golem.errors import ConfigError, needs
from golem.middleware.bags.base import BagMessage, BagTopic
from golem.middleware.bags.recorder import Recorder
from golem.middleware.web_gate import OriginGate, TokenGate, hidden_loopback, is_loopback

with needs("foxglove-sdk", "foxglove"):
    import foxglove
    from foxglove.websocket import Capability


VIEWERS = ("https://app.foxglove.dev", "file://")
"""Origins beside those of this machine whose pages may connect to the loopback: Foxglove's own [assumption]."""
TIME_STEP = 10_000_000
"""Least time between two announcements of the time [ns]."""


@dataclass(frozen=True)
class ServerConfig:
    """Where the viewers connect.

    Attributes:
        host: address of the interface to listen on; `0.0.0.0` lets other machines in that know the token.
        port: port to listen on; 0 chooses a free one.
        backlog: messages that are kept for a viewer that is too slow; then the oldest is dropped.
    """

    host: str = "127.0.0.1"
    port: int = 8765
    backlog: int = 256


class FoxgloveServer:
    """Sends every message to the viewers that subscribe to its topic; see `Sink`."""

    def __init__(self, config: ServerConfig | None = None) -> None:
        """Listen. Raises ConfigError: the address cannot be listened on."""
        config = config or ServerConfig()
        self._context = foxglove.Context()
        self._channels: dict[str, foxglove.Channel] = {}
        self._latched: dict[str, BagMessage] = {}
        self._newcomers: set[str] = set()
        self._lock = threading.Lock()
        self._now = self._announced = -TIME_STEP
        inner, local = hidden_loopback(), is_loopback(config.host)
        try:
            self._server = foxglove.start_server(
                name="golem",
                host=inner,
                port=0,
                capabilities=[Capability.Time],
                supported_encodings=["cdr"],
                server_listener=_Listener(self),
                context=self._context,
                message_backlog_size=config.backlog,
            )
        except (RuntimeError, OSError) as error:
            raise ConfigError(
                f"Cannot listen on {config.host}:{config.port} ({error}); choose another port or host."
            ) from error
        server = inner, self._server.port
        try:
            if local:
                self._gate = OriginGate(config.host, config.port, server, VIEWERS)
                self.url = f"ws://{config.host}:{self._gate.port}"
            else:
                self._gate = TokenGate(config.host, config.port, server)
                self.url = f"ws://{config.host}:{self._gate.port}/?token={self._gate.token}"
        except ConfigError:
            self._server.stop()
            raise

    def wanted(self, topic: BagTopic) -> bool:
        """Offer `topic` to the viewers, and return whether one subscribes to it."""
        return self._channel(topic).has_sinks()

    def write(self, message: BagMessage) -> None:
        """Send one message; see `Sink`. What is said once and holds is repeated to viewers that come later."""
        topic = message.topic
        if topic.qos.transient_local:
            self._latched[topic.name] = message
        self._now = message.log_time
        if not 0 <= self._now - self._announced < TIME_STEP:
            self._announced = self._now
            self._server.broadcast_time(message.log_time)
        self.refresh()
        self._channel(topic).log(bytes(message.payload), log_time=message.log_time)

    def refresh(self) -> None:
        """Repeat to new viewers what holds."""
        with self._lock:
            newcomers, self._newcomers = self._newcomers, set()
        for name in newcomers:
            held = self._latched.get(name)
            if held is not None:
                self._channel(held.topic).log(bytes(held.payload), log_time=max(self._now, held.log_time))

    def choose(self, recorder: Recorder, topics: Iterable[BagTopic]) -> None:
        """Let `recorder`, whose sink this is, take those of `topics` that a viewer wants."""
        for topic in topics:
            if self.wanted(topic):
                recorder.add([topic])
            else:
                recorder.remove(topic.name)
        self.refresh()

    def subscribed(self, name: str) -> None:
        """Note that a viewer subscribed to the topic called `name`; from any thread."""
        with self._lock:
            self._newcomers.add(name)

    def close(self) -> None:
        """Send the viewers away; see `Sink`."""
        self._gate.close()
        self._server.stop()
        for channel in self._channels.values():
            channel.close()
        self._channels.clear()

    def _channel(self, topic: BagTopic) -> foxglove.Channel:
        channel = self._channels.get(topic.name)
        if channel is None:
            schema = foxglove.Schema(name=topic.kind, encoding="ros2msg", data=topic.definition.encode())
            channel = foxglove.Channel(topic.name, schema=schema, message_encoding="cdr", context=self._context)
            self._channels[topic.name] = channel
        return channel


class _Listener(foxglove.websocket.ServerListener):
    def __init__(self, server: FoxgloveServer) -> None:
        self._server = server

    def on_subscribe(self, client: Any, channel: Any) -> None:
        self._server.subscribed(channel.topic)
