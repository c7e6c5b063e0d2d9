"""The commands as processes of their own, on a real domain."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("cyclonedds")
pytest.importorskip("mcap")
pytest.importorskip("rosbags")

from golem.interfaces.public import topic
from golem.middleware.bags.reader import Bag
from golem.middleware.dds.base import Qos, Reader, Sample, Writer
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.ros import codec, names
from golem.middleware.ros.msgs.sensor_msgs import Image
from golem.middleware.ros.msgs.std_msgs import Header, String
from golem.middleware.wire.convert import decode_low_state, encode_low_state
from golem.types import Imu, LowState

DESCRIPTION, COLOR, STATE = "/robot_description", "/realsense/head/color/image_raw", "/lowstate"


@pytest.fixture
def robot(domain: int) -> Iterator[CycloneParticipant]:
    participant = connect(DdsConfig(domain))
    yield participant
    participant.close()


def writer(robot: CycloneParticipant, name: str) -> Writer:
    row = topic(name)
    return robot.writer(names.topic(name), codec.dds_name(row.type), row.qos)


def state(t: float) -> bytes:
    zero = np.zeros(27)
    return encode_low_state(LowState(t, zero + t, zero, zero, Imu(np.array([1.0, 0, 0, 0]), np.zeros(3), np.zeros(3))))


def image(i: int) -> bytes:
    data = np.full(640 * 480 * 3, i % 256, np.uint8)
    return codec.serialize(Image(Header(frame_id=str(i)), 480, 640, "rgb8", 0, 1920, data))


@contextmanager
def golem(*words: str) -> Iterator[subprocess.Popen[str]]:
    """Run a command of its own; killed at the latest at the end."""
    process = subprocess.Popen(
        [sys.executable, "-c", "from golem.cli import main; main()", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + 30.0
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.slow
def test_ctrl_c_completes_the_bag(robot: CycloneParticipant, domain: int, tmp_path: Path) -> None:
    """Latched, fast, large and private topics arrive byte for byte, none lost, in a finished bag."""
    chatter = robot.writer("rt/chatter", "std_msgs::msg::dds_::String_", Qos(depth=100))
    description, color, low = (writer(robot, name) for name in (DESCRIPTION, COLOR, STATE))
    model = codec.serialize(String(data="<robot/>"))
    description.write(model)
    sent: dict[str, list[bytes]] = {DESCRIPTION: [model], COLOR: [], STATE: [], "/chatter": [model]}
    with golem("record", str(tmp_path / "bag"), "--all", "--domain", str(domain)) as recorder:
        until(lambda: all(w.matched() for w in (color, low, description, chatter)))
        chatter.write(model)
        for i in range(500):
            sent[STATE].append(state(i * 0.002))
            low.write(sent[STATE][-1])
            if i % 33 == 0:
                sent[COLOR].append(image(i))
                color.write(sent[COLOR][-1])
            time.sleep(0.002)
        time.sleep(0.3)
        recorder.send_signal(signal.SIGINT)
        out = recorder.communicate(timeout=30)[0]
        assert recorder.returncode == 0, out
    bag = Bag(tmp_path / "bag")
    assert bag.finished and (tmp_path / "bag" / "metadata.yaml").is_file()
    got: dict[str, list[bytes]] = {}
    for message in bag.messages():
        got.setdefault(message.topic.name, []).append(bytes(message.payload))
    assert got == sent
    assert f"{len(sent[COLOR]) + 502} messages" in out and "lost" not in out
    assert decode_low_state(got[STATE][7]).q[3] == pytest.approx(0.014)


@pytest.mark.slow
def test_a_killed_recorder_leaves_what_it_had(robot: CycloneParticipant, domain: int, tmp_path: Path) -> None:
    """SIGKILL: everything up to about a second before is there, and can be repaired and read by the official reader."""
    low = writer(robot, STATE)
    sent: list[tuple[float, bytes]] = []
    with golem("record", str(tmp_path / "bag"), "--domain", str(domain), "--topics", STATE) as recorder:
        until(lambda: low.matched() > 0)
        time.sleep(0.5)  # the writer may know the recorder before the recorder knows the writer
        for i in range(1500):
            sent.append((time.monotonic(), state(i * 0.002)))
            low.write(sent[-1][1])
            time.sleep(0.002)
        recorder.kill()
        killed = time.monotonic()
        recorder.wait()
    bag = Bag(tmp_path / "bag")
    assert not bag.finished
    got = [bytes(m.payload) for m in bag.messages()]
    assert got == [payload for _, payload in sent[: len(got)]]
    must = sum(t < killed - 2.0 for t, _ in sent)
    assert len(got) >= must > 100
    with golem("record", str(tmp_path / "bag"), "--repair") as repairer:
        assert f"{len(got)} messages of 1 topics" in repairer.communicate(timeout=30)[0]
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as file:
        ticks = [m.tick for *_, m in make_reader(file, True, [DecoderFactory()]).iter_decoded_messages()]
    assert ticks == [2 * i for i in range(len(got))]


@pytest.mark.slow
def test_a_bag_is_played_onto_a_domain(robot: CycloneParticipant, domain: int, tmp_path: Path) -> None:
    from golem.interfaces.recorded import public_topics
    from golem.middleware.bags.base import BagMessage
    from golem.middleware.bags.writer import BagWriter

    (low,) = public_topics([STATE])
    bag = BagWriter(tmp_path / "bag")
    for i in range(200):
        bag.write(BagMessage(low, i * 2_000_000, 0, state(i * 0.002)))
    bag.close()
    row = topic(STATE)
    states = robot.reader("rt/lowstate", codec.dds_name(row.type), Qos(reliable=False, depth=1000))
    clock = robot.reader("rt/clock", codec.dds_name("rosgraph_msgs/msg/Clock"), Qos(depth=1000))
    with golem("replay", str(tmp_path / "bag"), "--domain", str(domain), "--rate", "0.5") as player:
        out = player.communicate(timeout=30)[0]
        assert player.returncode == 0 and "200 messages" in out
    assert [decode_low_state(s.payload).t for s in _all(states)] == pytest.approx([i * 0.002 for i in range(200)])
    assert len(_all(clock)) == 40
    writer(robot, STATE)
    with golem("replay", str(tmp_path / "bag"), "--domain", str(domain)) as player:
        out = player.communicate(timeout=30)[0]
        assert player.returncode == 2 and "There is a robot on" in out


def _all(reader: Reader) -> list[Sample]:
    out: list[Sample] = []
    while samples := reader.take():
        out += [s for s in samples if s.alive]
    return out


@pytest.mark.slow
def test_a_domain_is_served_to_foxglove(robot: CycloneParticipant, domain: int) -> None:
    """A viewer that subscribes gets the very bytes, a latched one too; nothing is read before it asks."""
    pytest.importorskip("foxglove")
    from websockets.sync.client import connect as open_socket
    from websockets.typing import Subprotocol

    color, description = writer(robot, COLOR), writer(robot, DESCRIPTION)
    model = codec.serialize(String(data="<robot/>"))
    description.write(model)
    with golem("view", "--port", "0", "--domain", str(domain)) as server:
        assert server.stdout is not None
        url = re.search(r"ws://\S+", server.stdout.readline())
        assert url is not None
        with open_socket(url.group(), subprotocols=[Subprotocol("foxglove.sdk.v1")], max_size=None) as viewer:
            ids: dict[str, int] = {}
            while not {COLOR, DESCRIPTION} <= ids.keys():
                frame = viewer.recv(10.0)
                if isinstance(frame, str) and json.loads(frame)["op"] == "advertise":
                    ids |= {c["topic"]: c["id"] for c in json.loads(frame)["channels"]}
            assert color.matched() == 0
            wanted = [{"id": i, "channelId": ids[name]} for i, name in enumerate((COLOR, DESCRIPTION))]
            viewer.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            until(lambda: color.matched() > 0)
            color.write(image(7))
            got: dict[int, bytes] = {}
            while len(got) < 2:
                frame = viewer.recv(10.0)
                if isinstance(frame, bytes) and frame[0] == 1:
                    got[int.from_bytes(frame[1:5], "little")] = frame[13:]
        assert got == {0: image(7), 1: model}
        server.send_signal(signal.SIGINT)
        assert server.wait(10) == 0
