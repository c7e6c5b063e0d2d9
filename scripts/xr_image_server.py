"""Sends the cameras of a robot as xr_teleoperate's image client reads them, from its ROS topics.

    python scripts/xr_image_server.py --port 5555 --dds.domain 1

Its protocol is one ZeroMQ PUB socket; a message is a JPEG of the head camera, once for each eye, and the wrists' beside
it where they are asked for (xr_teleoperate, teleop/image_server). Needs the extras `agent` and `dds`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
import tyro
import zmq

from golem.interfaces import public
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.interrupt import interrupted
from golem.runtime.live.node_setup import member

SIZE = (640, 480)
"""Width and height of one camera's part of the picture [px], as the client expects by default."""


@dataclass
class ServerConfig:
    """Where to send them."""

    port: int = 5555
    host: str = "127.0.0.1"
    """Address to listen on. Nobody is asked for a token: any other address shows the cameras to its whole network."""
    eyes: int = 2
    """How often the head's picture is sent side by side: 2 for a client that expects a stereo camera."""
    wrists: bool = True
    dds: DdsConfig = field(default_factory=DdsConfig)


def picture(message: Any) -> np.ndarray:
    """Return the picture in a CompressedImage, black where none came."""
    if message is None:
        return np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    found = cv2.imdecode(np.frombuffer(bytes(message.data), np.uint8), cv2.IMREAD_COLOR)
    return np.zeros((SIZE[1], SIZE[0], 3), np.uint8) if found is None else cv2.resize(found, SIZE)


def serve(config: ServerConfig) -> None:
    """Send a picture for every one of the head camera, until Ctrl-C."""
    cameras = ["head"] * config.eyes + ["left_hand", "right_hand"] * config.wrists
    with interrupted() as stop, member("xr_images", config.dds) as (_, node), zmq.Context() as context:
        rows = {name: public.topic(public.image(name, public.COLOR_JPEG)) for name in cameras}
        images = {name: node.subscription(row.name, row.type, None, row.qos) for name, row in rows.items()}
        socket = context.socket(zmq.PUB)
        socket.setsockopt(zmq.SNDHWM, 2)  # who is slow misses pictures, and holds nobody up
        socket.setsockopt(zmq.LINGER, 0)
        socket.bind(f"tcp://{config.host}:{config.port}")
        sent = -1
        while not stop.is_set():
            node.spin_once(0.02)
            if images["head"].count() != sent:
                sent = images["head"].count()
                socket.send(
                    cv2.imencode(".jpg", np.hstack([picture(images[n].latest()) for n in cameras]))[1].tobytes()
                )
        socket.close()


if __name__ == "__main__":
    serve(tyro.cli(ServerConfig))
