"""`golem view`: a domain before the eyes of viewers."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field

from tyro.conf import OmitArgPrefixes

from golem.errors import unknown_name
from golem.interfaces import public
from golem.interfaces.recorded import public_topics
from golem.middleware.bags.base import BagTopic
from golem.middleware.bags.foxglove_server import FoxgloveServer, ServerConfig
from golem.middleware.bags.recorder import Recorder
from golem.middleware.dds.base import Participant
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.interrupt import interrupted
from golem.runtime.live.exclusive_writers import identity

PERIOD = 0.02
"""Time between two looks at what has come [s] [own]: half a frame of a camera at 25 Hz."""


@dataclass(frozen=True)
class ViewConfig:
    """Serve a domain to Foxglove; open the address that is printed there."""

    topics: tuple[str, ...] = ()
    """Public topics to offer, by their ROS names; default: all, images as they are."""
    host: str = "127.0.0.1"
    """Address to listen on; 0.0.0.0 lets other machines in that know the token in the address that is printed."""
    port: int = 8765
    """Port to listen on."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


def run_view(config: ViewConfig) -> None:
    """Serve until Ctrl-C. Raises ConfigError: an option is wrong, or the port taken; DdsError: no domain."""
    topics = public_topics(config.topics)
    for name in config.topics:
        if name not in {topic.name for topic in topics}:
            raise unknown_name("public topic", name, (row.name for row in public.TOPICS))
    with closing(connect(config.dds, identity("view"))) as participant, interrupted() as stop:
        with closing(FoxgloveServer(ServerConfig(config.host, config.port))) as server:
            print(f"Serving {config.dds} at {server.url} (in Foxglove: Open connection). Ctrl-C ends it.", flush=True)
            serve(participant, topics, server, stop)


def serve(participant: Participant, topics: Sequence[BagTopic], server: FoxgloveServer, stop: threading.Event) -> None:
    """Send viewers what they subscribe to until `stop` is set; nothing else is taken off the domain but the time."""
    with closing(Recorder(participant, server)) as recorder:
        while not stop.wait(PERIOD):
            server.choose(recorder, topics)
            recorder.poll()
