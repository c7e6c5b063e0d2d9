from __future__ import annotations

import json
import socket

import pytest

pytest.importorskip("rosbags")
pytest.importorskip("foxglove")

from websockets.sync.client import connect
from websockets.typing import Subprotocol

from golem.errors import ConfigError
from golem.middleware.ros import codec
from golem.middleware.ros.msgs.rosgraph_msgs import Clock
from golem.middleware.wire.convert import decode_low_state
from golem.run import RunConfig, run_stack
from golem.runtime.live.broadcast import broadcast
from golem.runtime.lockstep import build
from golem.stack import load_stack


@pytest.mark.slow
def test_viewers_see_a_stack_in_lock_step() -> None:
    """Live messages at robot time, and what was said once before they came."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    running, robot = build(load_stack("tether"), seed=0)
    wanted = ("/lowstate", "/clock", "/robot_description")
    with broadcast(running, robot, foxglove=port) as show:

        def pass_time(seconds: float) -> None:
            running.executor.run(running.executor.t + seconds, lambda: show() is not None)

        with connect(f"ws://127.0.0.1:{port}", subprotocols=[Subprotocol("foxglove.sdk.v1")], max_size=None) as viewer:
            ids: dict[str, int] = {}
            while not set(wanted) <= ids.keys():
                frame = viewer.recv(10.0)
                if isinstance(frame, str) and json.loads(frame)["op"] == "advertise":
                    ids |= {c["topic"]: c["id"] for c in json.loads(frame)["channels"]}
            asked = [{"id": i, "channelId": ids[name]} for i, name in enumerate(wanted)]
            viewer.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
            got: dict[int, tuple[float, bytes]] = {}
            while len(got) < len(wanted):
                pass_time(0.1)
                try:
                    while True:
                        frame = viewer.recv(0.05)
                        if isinstance(frame, bytes) and frame[0] == 1:
                            at = int.from_bytes(frame[5:13], "little") / 1e9
                            got[int.from_bytes(frame[1:5], "little")] = at, frame[13:]
                except TimeoutError:
                    pass
    robot.close()
    at, payload = got[0]
    assert decode_low_state(payload).t == pytest.approx(at)
    at, payload = got[1]
    clock = codec.deserialize(payload, Clock).clock
    assert clock.sec + clock.nanosec / 1e9 == pytest.approx(at)
    assert b"<robot name=" in got[2][1]


def test_an_operated_stack_is_recorded_on_its_domain() -> None:
    with pytest.raises(ConfigError, match="golem twin"):
        run_stack(RunConfig("stand", foxglove=True))
