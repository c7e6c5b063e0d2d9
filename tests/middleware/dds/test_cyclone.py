"""What only the Cyclone transport does: domains, interfaces, discovery, a thread, other processes."""

from __future__ import annotations

import ctypes
import logging
import os
import signal
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from importlib import metadata

import pytest

pytest.importorskip("cyclonedds")

from tests.middleware.dds.test_contract import TYPE, eventually, texts

from golem.errors import ConfigError, MissingExtra
from golem.middleware.dds import discovery, domain, endpoints, library
from golem.middleware.dds.base import ENCAPSULATION, DdsError, Qos, Sample
from golem.middleware.dds.connect import connect, self_test
from golem.middleware.dds.domain import DdsConfig, configuration
from golem.middleware.dds.interfaces import Interface, find_interface, interfaces
from golem.middleware.dds.participant import CycloneParticipant

SAMPLE = ENCAPSULATION + b"text"


@pytest.fixture
def participant(domain: int) -> Iterator[CycloneParticipant]:
    member = connect(DdsConfig(domain), "enclave=/;")
    yield member
    member.close()


@pytest.mark.parametrize("number", [-1, 233])
def test_a_domain_that_does_not_exist_is_refused(number: int) -> None:
    with pytest.raises(ConfigError, match="choose one of 0 to 232"):
        DdsConfig(number)


def test_the_robots_domain_must_be_meant() -> None:
    with pytest.raises(ConfigError, match=r"0 is the real robot's.*--robot"):
        DdsConfig(0)


def test_a_wrong_interface_is_named_with_those_there_are(domain: int) -> None:
    loopback = find_interface("lo")
    assert loopback.loopback and loopback in interfaces()
    with pytest.raises(ConfigError, match=rf"'lol'; valid: .*{loopback.name}"):
        connect(DdsConfig(domain, interface="lol"))


def test_an_interface_without_multicast_needs_peers(monkeypatch: pytest.MonkeyPatch) -> None:
    tunnel = Interface("tun0", loopback=False, multicast=False)
    monkeypatch.setattr(domain, "find_interface", lambda name: tunnel)
    with pytest.raises(DdsError, match=r"'tun0' has no multicast.*peers"):
        connect(DdsConfig(9, interface="tun0"))
    assert '<Peer address="10.0.0.7"' in configuration(tunnel, ("10.0.0.7",))


def test_participants_of_a_process_share_a_domain_on_the_same_terms(
    participant: CycloneParticipant, domain: int
) -> None:
    with pytest.raises(DdsError, match="already open"):
        connect(DdsConfig(domain, peers=("127.0.0.1",)))
    second = connect(DdsConfig(domain))
    second.close()
    assert len(discovery.members(participant)) == 1
    participant.close()
    connect(DdsConfig(domain, peers=("127.0.0.1",))).close()


def test_a_participant_can_be_closed_from_its_callback(participant: CycloneParticipant) -> None:
    closed = threading.Event()

    def close() -> None:
        participant.close()
        closed.set()

    reader = participant.reader("rt/a", TYPE, Qos(), on_data=close)
    participant.writer("rt/a", TYPE, Qos()).write(SAMPLE)
    assert closed.wait(5.0)
    with pytest.raises(DdsError, match="closed"):
        reader.take()
    with pytest.raises(DdsError, match="closed"):
        participant.writer("rt/b", TYPE, Qos())


def test_a_callback_that_raises_is_logged_and_called_again(
    participant: CycloneParticipant, caplog: pytest.LogCaptureFixture
) -> None:
    calls: list[int] = []
    second: list[str] = []

    def on_data() -> None:
        calls.append(1)
        if len(calls) == 1:
            raise RuntimeError("first")
        second.extend(texts(reader.take()))

    reader = participant.reader("rt/a", TYPE, Qos(), on_data=on_data)
    writer = participant.writer("rt/a", TYPE, Qos())
    with caplog.at_level(logging.ERROR):
        writer.write(SAMPLE)
        eventually(lambda: "callback of 'rt/a' failed" in caplog.text)
    writer.write(ENCAPSULATION + b"more")
    eventually(lambda: second)
    assert second == ["more"] and len(calls) == 2


def test_threads_may_share_a_writer_and_a_reader(participant: CycloneParticipant) -> None:
    reader = participant.reader("rt/a", TYPE, Qos(depth=None))
    writer = participant.writer("rt/a", TYPE, Qos(depth=None))
    payloads = [ENCAPSULATION + bytes([65 + i]) * (5 + i) for i in range(4)]
    taken: list[str] = []

    def write(payload: bytes) -> None:
        for _ in range(300):
            writer.write(payload)

    def take() -> None:
        eventually(lambda: taken.extend(texts(reader.take(7))) or len(taken) >= 1200)

    threads = [threading.Thread(target=write, args=(payload,)) for payload in payloads]
    threads += [threading.Thread(target=take) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(taken) == sorted(texts([Sample(p, 0.0, 0) for p in payloads]) * 300)


def test_closed_endpoints_leave_nothing_behind(participant: CycloneParticipant) -> None:
    def turn() -> None:
        reader = participant.reader("rt/a", TYPE, Qos(), on_data=lambda: None)
        participant.writer("rt/a", TYPE, Qos()).close()
        reader.close()

    def held() -> tuple[int, int]:
        return len(os.listdir("/proc/self/fd")), threading.active_count()

    turn()
    before = held()
    for _ in range(100):
        turn()
    assert held() == before and not participant._endpoints


def test_discovery_tells_who_is_there(participant: CycloneParticipant, domain: int) -> None:
    other = connect(DdsConfig(domain))
    qos = Qos(reliable=False, transient_local=True, depth=3)
    writer = participant.writer("rt/a", TYPE, qos, "typehash=x;")
    reader = other.reader("rt/b", TYPE, Qos(depth=None))
    try:
        (wrote,), (read,) = discovery.writers(other), discovery.readers(other)
        assert {m.guid: m.user_data for m in discovery.members(other)} == {
            participant.guid: "enclave=/;",
            other.guid: "",
        }
        assert (wrote.topic, wrote.type_name, wrote.qos, wrote.user_data) == ("rt/a", TYPE, qos, "typehash=x;")
        assert (wrote.guid, wrote.participant) == (writer.guid, participant.guid)
        assert (read.topic, read.qos, read.guid) == ("rt/b", Qos(depth=None), reader.guid)
    finally:
        other.close()


def test_the_self_test_sees_structs_of_another_layout(monkeypatch: pytest.MonkeyPatch) -> None:
    self_test.cache_clear()

    shifted = struct.Struct("@III?xxxxxxxxqQQ5I4x")
    monkeypatch.setattr(endpoints, "_INFO", shifted)
    monkeypatch.setattr(endpoints, "SampleInfo", ctypes.c_ubyte * shifted.size)
    with pytest.raises(DdsError, match="does not give back what it was sent"):
        self_test()
    monkeypatch.undo()
    self_test()


def test_another_series_of_cyclone_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    library.cyclone.cache_clear()
    monkeypatch.setattr(metadata, "version", lambda name: "11.1.0")
    with pytest.raises(DdsError, match=r"11\.1\.0 is installed.*pip install 'cyclonedds>="):
        library.cyclone()
    monkeypatch.undo()
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtra, match=r"golem-humanoid\[dds\]"):
        library.cyclone()


STALLED = """
import sys
from golem.middleware.dds.base import Qos
from golem.middleware.dds.connect import connect, self_test
from golem.middleware.dds.domain import DdsConfig
reader = connect(DdsConfig(int(sys.argv[1]))).reader("rt/a", sys.argv[2], Qos(depth=1))
sys.stdin.read()
"""


def test_a_stalled_reader_costs_samples_but_neither_an_error_nor_the_loop(
    participant: CycloneParticipant, domain: int
) -> None:
    writer = participant.writer("rt/a", TYPE, Qos(depth=None))
    other = subprocess.Popen([sys.executable, "-c", STALLED, str(domain), TYPE], stdin=subprocess.PIPE)
    try:
        eventually(writer.matched)
        other.send_signal(signal.SIGSTOP)
        for _ in range(100):
            writer.write(ENCAPSULATION + bytes(100_000))
            if writer.dropped >= 2:
                break
        assert writer.dropped == 2
    finally:
        other.send_signal(signal.SIGCONT)
        other.kill()


OTHER = """
import sys, time
from golem.middleware.dds.base import Qos
from golem.middleware.dds.connect import connect, self_test
from golem.middleware.dds.domain import DdsConfig
participant = connect(DdsConfig(int(sys.argv[1])))
writer = participant.writer("rt/a", sys.argv[2], Qos(depth=None))
while not writer.matched():
    time.sleep(0.01)
for i in range(500):
    writer.write(b"\\0\\1\\0\\0" + str(i).encode())
sys.stdin.read()
"""


def test_another_process_sends_all_and_leaves_at_its_end(participant: CycloneParticipant, domain: int) -> None:
    reader = participant.reader("rt/a", TYPE, Qos(depth=None))
    arguments = [sys.executable, "-c", OTHER, str(domain), TYPE]
    other = subprocess.Popen(arguments, stdin=subprocess.PIPE)
    try:
        got: list[str] = []
        eventually(lambda: got.extend(texts(reader.take())) or len(got) >= 500)
        assert got == [str(i) for i in range(500)]
        other.communicate(timeout=10.0)  # It ends without closing anything: its exit handler does.
        assert other.returncode == 0
        eventually(lambda: not reader.matched())
    finally:
        other.kill()
