"""Datagrams that nobody sane sends: true ones of a running domain, mutated, at the ports of a process of ours."""

from __future__ import annotations

import os
import random
import resource
import socket
import subprocess
import sys
import time

import pytest

pytest.importorskip("cyclonedds")

pytestmark = pytest.mark.slow
COUNT = int(os.environ.get("GOLEM_FUZZ_DATAGRAMS", "20000"))
MEMORY = 100e6
"""How much a process may grow meanwhile [bytes]."""
VICTIM = """
import sys, time
from golem.middleware.dds.base import Qos
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
own, others = sys.argv[2:]
participant = connect(DdsConfig(int(sys.argv[1])))
writer = participant.writer(own, "T", Qos())
taken = []
reader = participant.reader(others, "T", Qos(), on_data=lambda: taken.extend(reader.take()))
while not writer.matched():
    time.sleep(0.01)
print("ready", flush=True)
for line in sys.stdin:
    writer.write(b"\\0\\1\\0\\0" + line.encode())
"""


def ports_of(pid: int) -> set[int]:
    """Return the UDP ports of a process, so that no other process on this machine is shot at."""
    links = [os.readlink(link.path) for link in os.scandir(f"/proc/{pid}/fd")]
    inodes = {link[len("socket:[") : -1] for link in links if link.startswith("socket:[")}
    with open("/proc/net/udp", encoding="ascii") as table:
        rows = [line.split() for line in table.readlines()[1:]]
    return {int(row[1].split(":")[1], 16) for row in rows if row[9] in inodes}


def recorded(sniffer: socket.socket, ports: list[int], seconds: float) -> list[tuple[int, bytes]]:
    """Return port and content of the RTPS datagrams to `ports` that pass on the loopback interface."""
    found: dict[bytes, int] = {}
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            packet = sniffer.recv(65535)
        except TimeoutError:
            continue
        ip = 14  # after the Ethernet header: IPv4, then UDP
        udp = ip + 4 * (packet[ip] & 15)
        if packet[ip + 9] == socket.IPPROTO_UDP and packet[udp + 8 : udp + 12] == b"RTPS":
            found[packet[udp + 8 :]] = int.from_bytes(packet[udp + 2 : udp + 4], "big")
    return [(port, content) for content, port in found.items() if port in ports]


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Return a datagram with bits flipped, words replaced, cut off or spliced."""
    changed = bytearray(data)
    for _ in range(rng.randrange(1, 5)):
        if len(changed) < 8:
            break
        at = rng.randrange(4, len(changed))
        match rng.randrange(5):
            case 0:
                changed[at] ^= 1 << rng.randrange(8)
            case 1:
                word = rng.choice((0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFF, rng.randrange(2**32)))
                changed[at : at + 4] = word.to_bytes(4, rng.choice(("little", "big")))
            case 2:
                del changed[at:]
            case 3:
                changed[at:at] = changed[: rng.randrange(64)]
            case _:
                changed[at : at + 8] = rng.randbytes(8)
    return bytes(changed[:65000])


def memory(pid: int) -> int:
    with open(f"/proc/{pid}/statm", encoding="ascii") as status:
        return int(status.read().split()[1]) * resource.getpagesize()


def test_mutated_datagrams_neither_end_nor_fill_a_process(domain: int) -> None:
    try:
        sniffer = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3))
    except (PermissionError, AttributeError):
        pytest.skip("needs the right to listen to the loopback interface: root on Linux")
    sniffer.bind(("lo", 0))
    sniffer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
    sniffer.settimeout(0.1)
    victims = [start(domain, "rt/a", "rt/b"), start(domain, "rt/b", "rt/a")]
    try:
        for victim in victims:
            assert victim.stdout is not None and victim.stdout.readline().strip() == "ready"
        # Multicast goes by a port that all processes of the domain share; the others belong to one process.
        ports = sorted({port for victim in victims for port in ports_of(victim.pid)})
        corpus: list[tuple[int, bytes]] = []
        for i in range(20):
            for victim in victims:
                assert victim.stdin is not None
                victim.stdin.write("x" * (1 + 400 * i) + "\n")
                victim.stdin.flush()
            corpus += recorded(sniffer, ports, 0.1)
        assert len(corpus) > 40
        before = [memory(victim.pid) for victim in victims]
        rng = random.Random(1)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for i in range(COUNT):
                port, content = rng.choice(corpus)
                target = port if rng.random() < 0.8 else rng.choice(ports)
                sender.sendto(mutated(content, rng), ("127.0.0.1", target))
                if i % 50 == 0:
                    time.sleep(0.002)
                    codes = [victim.poll() for victim in victims]
                    assert codes == [None, None], f"after {i} datagrams a process ended: {codes}"
        time.sleep(1.0)
        assert [victim.poll() for victim in victims] == [None, None]
        assert all(memory(v.pid) - held < MEMORY for v, held in zip(victims, before, strict=True))
    finally:
        for victim in victims:
            victim.kill()
        sniffer.close()


def start(domain: int, own: str, others: str) -> subprocess.Popen[str]:
    """Start a process that writes on one topic what it is told and reads another; Cyclone's complaints are hidden."""
    return subprocess.Popen(
        [sys.executable, "-c", VICTIM, str(domain), own, others],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
