"""Services for clients of Fast DDS, ROS 2's default: what Cyclone cannot say to them is said by hand.

rmw_fastrtps pairs a reply with its request by a parameter beside the payload (`PID_RELATED_SAMPLE_IDENTITY`), where
rmw_cyclonedds has a header inside it, and Cyclone has no way to send that parameter. So a second, small RTPS
participant stands beside Cyclone's. It talks to participants of Fast DDS alone, has readers of requests and writers of
replies and nothing else, and looks from above like any participant: its payloads carry rmw_cyclonedds' header.
Topics, feedback and status of actions among them, go through Cyclone, which understands Fast DDS well.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterable

from golem.middleware.dds.base import Payload, Qos, Sample
from golem.middleware.dds.domain import first_port
from golem.middleware.ros.message import Header, pack, unpack
from golem.middleware.rtps import announcements, submessages
from golem.middleware.rtps.announcements import (
    KEYLESS_READER,
    KEYLESS_WRITER,
    PARTICIPANT,
    SPDP_READER,
    SPDP_WRITER,
    WRITERS_WRITER,
)
from golem.middleware.rtps.reliable import RETRY, FastDdsPeer
from golem.middleware.rtps.submessages import FAST_DDS, AckNack, Data, Gap, Heartbeat

GROUP = "239.255.0.1"
ANNOUNCE, LEASE = 3.0, 20.0
"""How often we say that we are there, and for how long that holds [s]; Fast DDS's own."""
MAX_PEERS = 128
MAX_CLIENTS = 4096
_MULTICAST_ALL = 49
"""IP_MULTICAST_ALL of Linux: off, a socket hears a group on the interface that it joined on, and on no other."""


class ServiceLink:
    """Offers services to clients of Fast DDS; `malformed` counts datagrams that could not be read."""

    def __init__(self, domain: int, address: str) -> None:
        """Listen for clients on the interface with this IPv4 address. Raises OSError: the ports cannot be had."""
        self.malformed = 0
        self._prefix = submessages.NO_VENDOR + os.urandom(10)
        self._group = _group_socket(first_port(domain), address)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((address, 0))
        port = self._socket.getsockname()[1]
        self._own = announcements.own_participant(self._prefix, address, port, LEASE)
        self._lock = threading.RLock()
        self._peers: dict[bytes, FastDdsPeer] = {}
        self._readers: dict[str, ServiceReader] = {}
        self._announced: list[tuple[bool, bytes, bytes]] = []
        self._clients: dict[int, bytes] = {}
        self._numbers: dict[bytes, int] = {}
        self._entities = 0
        self._open = True
        self._next_announcement = 0.0
        self._thread = threading.Thread(target=self._run, name="fast-dds", daemon=True)
        self._thread.start()

    def reader(
        self, topic: str, type_name: str, qos: Qos, user_data: str, on_data: Callable[[], None]
    ) -> ServiceReader:
        """Create a reader of requests; see `dds.base.Participant.reader`."""
        with self._lock:
            reader = ServiceReader(self, topic, self._guid(KEYLESS_READER), qos, on_data)
            self._readers[topic] = reader
            self._announce(False, reader.guid, topic, type_name, user_data)
            return reader

    def writer(self, topic: str, type_name: str, user_data: str) -> ServiceWriter:
        """Create a writer of replies; see `dds.base.Participant.writer`."""
        with self._lock:
            writer = ServiceWriter(self, self._guid(KEYLESS_WRITER))
            self._announce(True, writer.guid, topic, type_name, user_data)
            return writer

    def second_reader(self, topic: str, type_name: str, user_data: str) -> ServiceEndpoint:
        """Announce a best-effort reader of requests that reads none."""
        with self._lock:
            second = ServiceEndpoint(self, self._guid(KEYLESS_READER))
            self._announce(False, second.guid, topic, type_name, user_data, reliable=False)
            return second

    def withdraw(self, guid: bytes) -> None:
        """Take an endpoint back."""
        with self._lock:
            self._readers = {topic: reader for topic, reader in self._readers.items() if reader.guid != guid}
            self._announced = [entry for entry in self._announced if entry[1] != guid]
            for peer in self._peers.values():
                writing = guid[15] == KEYLESS_WRITER
                qos = _disposal(guid)
                self._send_discovery(peer, (peer.writers if writing else peer.readers).put(qos, b"", _now()))

    def reply(self, writer: bytes, client: int, sequence: int, body: bytes) -> None:
        """Send `body` from a writer (guid) of ours to a client, as the answer to its request `sequence`."""
        with self._lock:
            reader = self._clients.get(client, b"")
            peer = self._peers.get(reader[:12])
            if peer is not None:
                qos = submessages.related_sample(reader, sequence)
                self._send(peer, peer.replies(writer[12:], reader[12:]).put(qos, body, _now()))

    def matched(self, topic: str) -> int:
        """Return how many writers of requests are known of a topic."""
        with self._lock:
            return sum(known == topic for peer in self._peers.values() for known in peer.topics.values())

    def close(self) -> None:
        """Say goodbye, and stop; calling it again does nothing."""
        with self._lock:
            if not self._open:
                return
            self._open = False
            qos = _disposal(self._prefix + PARTICIPANT)
            for peer in self._peers.values():
                self._send_discovery(peer, [submessages.data(SPDP_WRITER, SPDP_READER, 2, qos, b"")])
            with contextlib.suppress(OSError):
                self._socket.sendto(b"", self._socket.getsockname())  # wakes the thread
        if self._thread is not threading.current_thread():
            self._thread.join()
        self._group.close()
        self._socket.close()

    def _run(self) -> None:
        while self._open:
            ready, _, _ = select.select((self._group, self._socket), (), (), RETRY if self._peers else None)
            calls: list[Callable[[], None]] = []
            with self._lock:
                for source in ready:
                    datagram, (address, _) = source.recvfrom(65536)
                    try:
                        self._take(datagram, address, calls)
                    except (ValueError, struct.error):
                        self.malformed += 1
                self._keep(_now())
            for call in calls:
                call()

    def _take(self, datagram: bytes, address: str, calls: list[Callable[[], None]]) -> None:
        if datagram[:4] != b"RTPS" or datagram[6:8] != FAST_DDS:
            return
        _, prefix, content = submessages.parse(datagram, self._prefix)
        for part in content:
            if isinstance(part, Data) and part.writer[12:] == SPDP_WRITER:
                self._meet(part, address)
                continue
            peer = self._peers.get(prefix)
            if peer is None:
                continue
            peer.seen = _now()
            if isinstance(part, AckNack):
                stream = peer.acknowledged(part.writer_id, part.reader[12:])
                if stream is not None:
                    again = stream.acknowledged(part.base, part.missing)
                    builtin = stream in (peer.writers, peer.readers)
                    (self._send_discovery if builtin else self._send)(peer, again)
            elif part.writer[12:] == WRITERS_WRITER:
                self._discover(peer, part)
            else:
                self._request(peer, part, calls)

    def _meet(self, sample: Data, address: str) -> None:
        prefix = (sample.key or sample.writer)[:12]
        if sample.disposed:
            self._peers.pop(prefix, None)
            return
        announced = announcements.participant(sample)
        peer = self._peers.get(prefix)
        if peer is not None:
            peer.seen, peer.announced = _now(), announced
        elif len(self._peers) < MAX_PEERS:
            peer = self._peers[prefix] = FastDdsPeer(prefix, announced, address, _now())
            self._greet(peer)
            for writing, _, said in self._announced:
                self._send_discovery(peer, (peer.writers if writing else peer.readers).put(b"", said, _now()))

    def _discover(self, peer: FastDdsPeer, part: Data | Heartbeat | Gap) -> None:
        if isinstance(part, Heartbeat):
            self._send_discovery(peer, [peer.found.heard(part)])
        elif isinstance(part, Gap):
            peer.found.gone(part)
        elif peer.found.take(part.sequence):
            if part.disposed:
                peer.forget(part.key)
            else:
                peer.learn(*announcements.endpoint(part))

    def _request(self, peer: FastDdsPeer, part: Data | Heartbeat | Gap, calls: list[Callable[[], None]]) -> None:
        reader = self._readers.get(peer.topics.get(part.writer, ""))
        if reader is None:
            return
        stream = peer.requests(reader.guid[12:], part.writer)
        if isinstance(part, Heartbeat):
            self._send(peer, [stream.heard(part)])
        elif isinstance(part, Gap):
            stream.gone(part)
        elif stream.take(part.sequence) and part.related is not None and len(part.payload) > 4:
            header = Header(self._number(part.related[0]), part.sequence)
            reader.put(Sample(pack(header, part.payload), time.time(), 0))
            calls.append(reader.on_data)

    def _number(self, client: bytes) -> int:
        """Return the number that stands for a client's reader of replies (guid)."""
        if client not in self._numbers:
            if len(self._numbers) >= MAX_CLIENTS:
                del self._clients[self._numbers.pop(next(iter(self._numbers)))]
            number = int.from_bytes(os.urandom(8), "little")
            self._numbers[client], self._clients[number] = number, client
        return self._numbers[client]

    def _keep(self, now: float) -> None:
        for peer in [p for p in self._peers.values() if now - p.seen > p.announced.lease]:
            del self._peers[peer.prefix]
        for peer in self._peers.values():
            self._send_discovery(peer, [*peer.writers.keep(now), *peer.readers.keep(now)])
            for stream in peer.data_streams():
                self._send(peer, stream.keep(now))
        if now >= self._next_announcement:
            self._next_announcement = now + ANNOUNCE
            for peer in self._peers.values():
                self._greet(peer)

    def _guid(self, kind: int) -> bytes:
        self._entities += 1
        return self._prefix + self._entities.to_bytes(3, "big") + bytes((kind,))

    def _announce(
        self, writing: bool, guid: bytes, topic: str, type_name: str, user_data: str, reliable: bool = True
    ) -> None:
        said = announcements.own_endpoint(guid, topic, type_name, user_data, reliable)
        self._announced.append((writing, guid, said))
        for peer in self._peers.values():
            self._send_discovery(peer, (peer.writers if writing else peer.readers).put(b"", said, _now()))

    def _greet(self, peer: FastDdsPeer) -> None:
        self._send_discovery(peer, [submessages.data(SPDP_WRITER, SPDP_READER, 1, b"", self._own)])

    def _send_discovery(self, peer: FastDdsPeer, content: Iterable[bytes]) -> None:
        self._send(peer, content, peer.announced.metatraffic)

    def _send(self, peer: FastDdsPeer, content: Iterable[bytes], port: int = 0) -> None:
        parts = list(content)
        if parts:
            datagram = submessages.message(self._prefix, peer.prefix, *parts)
            with contextlib.suppress(OSError):  # what is lost is asked for again
                self._socket.sendto(datagram, (peer.address, port or peer.announced.data))


class ServiceEndpoint:
    """What is announced, under a `guid` of 16 bytes, until it is closed."""

    def __init__(self, link: ServiceLink, guid: bytes) -> None:
        self._link, self.guid = link, guid

    def close(self) -> None:
        """Offer the service no more."""
        self._link.withdraw(self.guid)


class ServiceReader(ServiceEndpoint):
    """Requests of one service; see `dds.base.Reader`."""

    handle = 0

    def __init__(self, link: ServiceLink, topic: str, guid: bytes, qos: Qos, on_data: Callable[[], None]) -> None:
        super().__init__(link, guid)
        self.on_data, self._topic, self._depth = on_data, topic, qos.depth
        self._samples: list[Sample] = []
        self._lock = threading.Lock()

    def put(self, sample: Sample) -> None:
        """Keep a sample, while there is room."""
        with self._lock:
            if self._depth is None or len(self._samples) < self._depth:
                self._samples.append(sample)

    def take(self, maximum: int = 64) -> list[Sample]:
        with self._lock:
            taken, self._samples = self._samples[:maximum], self._samples[maximum:]
            return taken

    def matched(self) -> int:
        return self._link.matched(self._topic)

    def writers(self) -> dict[int, bytes]:
        """Return nothing: whom to answer is in the header."""
        return {}


class ServiceWriter(ServiceEndpoint):
    """Replies of one service."""

    def write(self, payload: Payload) -> None:
        """Send a reply to the client that its header names, and to nobody else."""
        header, body = unpack(payload)
        self._link.reply(self.guid, header.client, header.sequence, body)


def _group_socket(port: int, address: str) -> socket.socket:
    group = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    group.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    group.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
    group.bind((GROUP, port))
    joined = socket.inet_aton(GROUP) + socket.inet_aton(address)
    group.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, joined)
    with contextlib.suppress(OSError):
        group.setsockopt(socket.IPPROTO_IP, _MULTICAST_ALL, 0)
    return group


def _disposal(guid: bytes) -> bytes:
    status = struct.pack(">I", submessages.DISPOSED)
    return submessages.parameter_list([(submessages.STATUS_INFO, status), (submessages.KEY_HASH, guid)])


def _now() -> float:
    return time.monotonic()
