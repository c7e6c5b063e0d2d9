"""Cyclone DDS 0.10, as the vendor's SDK and ROS 2 Humble to Kilted use it, on topics of ours, in both directions.

A peer with generated types reads what we write, writes it again, and must exit with 0: a topic with type information
would make it crash. What comes back must be what was sent, to the byte.
"""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import time
from pathlib import Path

import pytest

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from tests.middleware.dds.cdr import MESSAGES, Cdr, image, message
from tests.middleware.dds.idl import idl, wire_name
from tests.middleware.ros.samples import random_message

from golem.interfaces import public
from golem.middleware.dds.base import Qos
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.ros.codec import codec, serialize

PEER = Path(__file__).parent / "peer"
COUNT = 20
OLD_PYTHON = "GOLEM_OLD_CYCLONE_PYTHON"
LOOPBACK = '<General><Interfaces><NetworkInterface name="lo"/></Interfaces></General>'
URI = f"<CycloneDDS><Domain>{LOOPBACK}</Domain></CycloneDDS>"
pytestmark = pytest.mark.slow


def build(work: Path, idl: Path) -> list[str]:
    """Return the command of the C peer for the types in a file."""
    if not shutil.which("idlc") or not shutil.which("gcc"):
        pytest.skip("needs Cyclone DDS 0.10 in C: apt-get install gcc cyclonedds-dev cyclonedds-tools")
    version = subprocess.run(["idlc", "-v"], capture_output=True, text=True, check=False)
    if "0.10" not in version.stdout + version.stderr:
        pytest.skip("needs Cyclone DDS 0.10 in C; the idlc found first is another: " + version.stdout)
    for command in (
        ["idlc", str(idl)],
        ["gcc", "-rdynamic", str(PEER / "peer.c"), idl.with_suffix(".c").name, "-lddsc", "-ldl", "-o", "peer"],
    ):
        subprocess.run(command, cwd=work, check=True, capture_output=True)
    return [str(work / "peer")]


@pytest.fixture(scope="module")
def c_peer(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    return build(tmp_path_factory.mktemp("c_peer"), PEER / "messages.idl")


@pytest.fixture(scope="module")
def c_peer_of_all(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    work = tmp_path_factory.mktemp("c_peer_of_all")
    file = work / "interfaces.idl"
    file.write_text(idl(interfaces(), codec()._types), encoding="utf-8")
    return build(work, file)


def interfaces() -> list[str]:
    """Return the ROS names of every type that is on one of our topics, those under services and actions included."""
    known = codec()
    names = {row.type for row in public.TOPICS} | {"rmw_dds_common/msg/ParticipantEntitiesInfo"}
    services = {row.type for row in public.SERVICES}
    for row in public.ACTIONS:
        kind = known.action(row.type)
        services |= {kind.SendGoal.name, kind.GetResult.name, "action_msgs/srv/CancelGoal"}
        names |= {f"{row.type}_FeedbackMessage", "action_msgs/msg/GoalStatusArray"}
    return sorted(names | {f"{service}_{part}" for service in services for part in ("Request", "Response")})


@pytest.fixture(scope="module")
def python_peer(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    python = os.environ.get(OLD_PYTHON, "")
    if not python:
        pytest.skip(f"needs {OLD_PYTHON}=PATH of a Python 3.10 that has the wheel cyclonedds==0.10.2")
    work = tmp_path_factory.mktemp("python_peer")
    tools = Path(python).parent
    path = f"{tools}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(
        [str(tools / "idlc"), "-l", "py", str(PEER / "messages.idl")],
        cwd=work,
        env={**os.environ, "PATH": path},
        check=True,
        capture_output=True,
    )
    shutil.copy(PEER / "peer.py", work)
    return [python, str(work / "peer.py")]


@pytest.mark.parametrize("language", ["c", "python"])
@pytest.mark.parametrize("type_name", MESSAGES)
def test_an_old_peer_sends_back_what_we_send(
    type_name: str, language: str, domain: int, request: pytest.FixtureRequest
) -> None:
    command: list[str] = request.getfixturevalue(f"{language}_peer")
    exchange(command, domain, type_name, [message(type_name, seed) for seed in range(COUNT)])


@pytest.mark.parametrize("language", ["c", "python"])
def test_an_old_peer_copes_with_our_large_datagrams(language: str, domain: int, request: pytest.FixtureRequest) -> None:
    sent = []
    for seed in range(5):
        cdr = Cdr()
        image(cdr, random.Random(seed), 480, 640)
        sent.append(cdr.sample())
    exchange(request.getfixturevalue(f"{language}_peer"), domain, "sensor_msgs::msg::dds_::Image_", sent)


@pytest.mark.parametrize("name", interfaces())
def test_an_old_peer_takes_part_in_every_topic_of_ours(name: str, domain: int, c_peer_of_all: list[str]) -> None:
    rng = random.Random(name)
    sent = [serialize(random_message(codec(), name, rng)) for _ in range(COUNT)]
    if name.endswith(("_Request", "_Response")):
        header = rng.randbytes(16)  # client and sequence number, before the body (rmw_cyclonedds, cdds_request_header)
        sent = [payload[:4] + header + payload[4:] for payload in sent]
    exchange(c_peer_of_all, domain, wire_name(name), sent)


def exchange(command: list[str], domain: int, type_name: str, sent: list[bytes]) -> None:
    """Send samples to a peer that sends them back; all must be whole and in order, and the peer must end well.

    Cyclone drops what comes before a writer's first heartbeat, and that heartbeat may come after the first sample
    though both sides have matched. So the first sample goes ahead, again and again, until one has come back.
    """
    participant = connect(DdsConfig(domain))
    reader = participant.reader("rt/back", type_name, Qos(depth=None))
    writer = participant.writer("rt/there", type_name, Qos(depth=None))
    peer = subprocess.Popen(
        [*command, str(domain), type_name], env={**os.environ, "CYCLONEDDS_URI": URI}, stdin=subprocess.PIPE
    )
    back: list[bytes] = []
    end = time.monotonic() + 20.0
    try:
        while not back and peer.poll() is None and time.monotonic() < end:
            writer.write(sent[0])
            time.sleep(0.02)
            back += [sample.payload for sample in reader.take() if sample.alive]
        for payload in sent:
            writer.write(payload)
        while not same(back[-len(sent) :], sent) and peer.poll() is None and time.monotonic() < end:
            back += [sample.payload for sample in reader.take() if sample.alive]
            time.sleep(0.005)
        peer.communicate(timeout=15.0)
        assert peer.returncode == 0
    finally:
        peer.kill()
        participant.close()
    ahead = len(back) - len(sent)
    assert same(back, [sent[0]] * ahead + sent), f"{len(back)} samples came back"


def same(back: list[bytes], sent: list[bytes]) -> bool:
    """Return whether samples are what was sent, but for the options in their header and up to 3 bytes of padding."""
    return len(back) == len(sent) and all(
        got[4 : len(payload)] == payload[4:] and len(got) - len(payload) < 4
        for got, payload in zip(back, sent, strict=True)
    )
