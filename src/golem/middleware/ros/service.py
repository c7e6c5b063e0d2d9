"""Services over the transport contract: a request topic, a reply topic, and a header that pairs what travels on them.

A client takes the replies that carry its handle. `clientid` and `serviceid` in USER_DATA, equal for the two endpoints
of a client or a server, let a peer know which reader belongs to which writer (`rmw_init_cs`, ros2/rmw_cyclonedds,
rmw_node.cpp). Clients of Fast DDS send no header: a server reads their requests by a `service_link.ServiceLink`, which
adds one, and not by the transport, which lets them pass without.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from golem.middleware.dds.base import Payload, Qos, Sample
from golem.middleware.ros import codec, names
from golem.middleware.ros.future import Future, RosError
from golem.middleware.ros.message import CodecError, Header, pack, unpack
from golem.middleware.ros.node_endpoints import NodeEndpoints
from golem.middleware.rtps.submessages import FAST_DDS

SERVICES = Qos(depth=1000)
"""ROS's service profile keeps 10; the depth is nobody else's business, and a burst of goals is larger than that."""
MAX_PENDING = 1000
"""Unanswered requests of one client; beyond it the oldest is given up."""
MAX_REACHED = 1000
"""Clients of one server that are remembered to be within reach."""
LARGEST = 65_000
"""Bytes of an answer to a client of Fast DDS [own]: one datagram takes it, 65 507 bytes, with what goes before it."""
HOLD = 0.1
"""How long a reply waits for the client's reader to be discovered [s]; that of `rmw_send_response`."""


class Origin(NamedTuple):
    """Where a request came from.

    Attributes:
        header: what its reply shall repeat.
        writer: handle of the client's request writer (uint64), as the server's participant knows it.
        linked: whether it came by the service link.
    """

    header: Header
    writer: int
    linked: bool = False


class Client:
    """Calls one service; `malformed` counts replies that could not be read."""

    def __init__(self, endpoints: NodeEndpoints, name: str, type: str) -> None:
        self.name, self.malformed = name, 0
        self._endpoints = endpoints
        self._type = codec.service(type)
        self._pending: dict[int, Future[Any]] = {}
        # Who could answer each of them: a successor of a server that died has never heard of it.
        self._servers: dict[int, frozenset[bytes]] = {}
        self._sequence = 0
        owner = f"clientid={endpoints.identity()};"
        # The reply reader first: a server then knows it when the first request arrives.
        self._inbox = endpoints.inbox(names.reply(name), f"{type}_Response", SERVICES, self._take, owner)
        self._writer = endpoints.writer(names.request(name), f"{type}_Request", SERVICES, owner)
        endpoints.attend(self)

    def ready(self) -> bool:
        """Return whether a server is there."""
        return self._writer.matched() > 0 and self._inbox.matched() > 0

    def call(self, request: Any) -> Future[Any]:
        """Send a request; the future brings the response. Raises CodecError: it is not of the service's type.

        It fails when no server is there or the server goes away; a server that does not answer is the caller's to
        give up on, with `RosNode.wait` or `Future.cancel`.
        """
        body = codec.serialize_as(f"Service '{self.name}'", request, self._type.Request)
        self._sequence += 1
        number = self._sequence
        future: Future[Any] = Future(lambda: self._forget(number))
        servers = frozenset(self._writer.readers().values()) if self._inbox.matched() else frozenset[bytes]()
        if all(server.startswith(FAST_DDS) for server in servers):
            alien = (
                f"The server of '{self.name}' speaks Fast DDS, which we cannot call: "
                "start it with RMW_IMPLEMENTATION=rmw_cyclonedds_cpp."
            )
            future.fail(RosError(alien if servers else f"No server of '{self.name}' is there."))
            return future
        if len(self._pending) >= MAX_PENDING:
            next(iter(self._pending.values())).cancel(f"'{self.name}' left {MAX_PENDING} newer requests unanswered.")
        self._pending[number], self._servers[number] = future, servers
        self._writer.write(pack(Header(self._writer.handle, number), body))
        return future

    def keep(self) -> None:
        """Give up on what will not be answered any more; called at every poll."""
        if not self._pending:
            return
        there = frozenset(self._writer.readers().values()) if self._inbox.matched() else frozenset()
        gone = [number for number, servers in self._servers.items() if not servers & there]
        for future in [self._pending[number] for number in gone]:
            future.cancel(f"The server of '{self.name}' has gone.")

    def close(self) -> None:
        """Stop; what is unanswered fails. Calling it again does nothing."""
        self._endpoints.dismiss(self)
        self._endpoints.close(self._writer, self._inbox)
        for future in list(self._pending.values()):
            future.cancel(f"The client of '{self.name}' was closed.")

    def _forget(self, number: int) -> None:
        self._pending.pop(number, None)
        self._servers.pop(number, None)

    def _take(self, sample: Sample) -> None:
        try:
            header, body = unpack(sample.payload)
            if header.client != self._writer.handle or header.sequence not in self._pending:
                return
            response = codec.deserialize(body, self._type.Response)
        except CodecError:
            self.malformed += 1
            return
        self._servers.pop(header.sequence)
        self._pending.pop(header.sequence).complete(response)


class Responder:
    """Answers a service, maybe later; `malformed` counts requests that could not be read."""

    def __init__(self, endpoints: NodeEndpoints, name: str, type: str, handle: Callable[[Origin, Any], None]) -> None:
        """Give requests for the service with absolute `name` to `handle`, which shall `reply` some time."""
        self.name, self.malformed = name, 0
        self._endpoints, self._handle = endpoints, handle
        self._type = codec.service(type)
        self._held: deque[tuple[float, int, bytes]] = deque(maxlen=SERVICES.depth)
        self._reached: set[int] = set()
        self._warned = False
        owner = f"serviceid={endpoints.identity()};"
        reply, request = names.reply(name), names.request(name)
        self._writer = endpoints.writer(reply, f"{type}_Response", SERVICES, owner)
        self._inbox = endpoints.inbox(request, f"{type}_Request", SERVICES, self._take, owner)
        self._linked = endpoints.linked(
            reply, request, type, SERVICES, lambda sample: self._receive(sample, True), owner
        )
        endpoints.attend(self)

    def reply(self, origin: Origin, response: Payload) -> None:
        """Answer the request that came from `origin` by `response` (CDR); by zeros where it is too large to be sent."""
        if origin.linked and len(response) > LARGEST:
            self._endpoints.guard.log(
                f"An answer of '{self.name}' has {len(response)} bytes, and clients of Fast DDS take {LARGEST}: one "
                "got zeros instead. Start it with RMW_IMPLEMENTATION=rmw_cyclonedds_cpp."
            )
            response = codec.serialize(self._type.Response())
        payload = pack(origin.header, response)
        if origin.linked and self._linked is not None:
            self._linked.writer.write(payload)
        elif self._reaches(origin.writer):
            self._writer.write(payload)
        else:
            self._held.append((time.monotonic() + HOLD, origin.writer, payload))

    def client(self, origin: Origin) -> bytes:
        """Return the 12 bytes of the process that a request came from; empty where nobody knows."""
        return self._inbox.writers().get(origin.writer, b"")[:12]

    def knows(self, client: bytes) -> bool:
        """Return whether the process `client` (12 bytes) can still send requests."""
        return any(guid[:12] == client for guid in self._inbox.writers().values())

    def keep(self) -> None:
        """Send the replies that waited for their reader long enough; called at every poll."""
        if not self._held:
            return
        reached = {writer: self._reaches(writer) for writer in {writer for _, writer, _ in self._held}}
        for _ in range(len(self._held)):
            end, writer, payload = held = self._held.popleft()
            if reached[writer] or time.monotonic() > end:
                self._writer.write(payload)
            else:
                self._held.append(held)

    def close(self) -> None:
        """Stop."""
        self._endpoints.dismiss(self)
        self._endpoints.close(self._inbox, self._writer)
        for endpoint in self._linked or ():
            endpoint.close()
        self._held.clear()

    def _reaches(self, writer: int) -> bool:
        """Return whether a reply reader is known of the participant with this request writer, or will never be."""
        if writer not in self._reached:
            guid = self._inbox.writers().get(writer)
            if guid is not None and all(r[:12] != guid[:12] for r in self._writer.readers().values()):
                return False
            if len(self._reached) >= MAX_REACHED:
                self._reached.clear()
            self._reached.add(writer)
        return True

    def _take(self, sample: Sample) -> None:
        sender = self._inbox.writers().get(sample.writer, b"")
        if not sender.startswith(FAST_DDS):
            self._receive(sample, False)
        elif self._linked is None and not self._warned:
            self._warned = True
            self._endpoints.guard.log(
                f"A client of Fast DDS calls '{self.name}' and gets no answer: on this machine we cannot speak to it. "
                "Start it with RMW_IMPLEMENTATION=rmw_cyclonedds_cpp."
            )

    def _receive(self, sample: Sample, linked: bool) -> None:
        try:
            header, body = unpack(sample.payload)
            request = codec.deserialize(body, self._type.Request)
        except CodecError:
            self.malformed += 1
            return
        self._handle(Origin(header, sample.writer, linked), request)


class Service:
    """Answers the requests of one service at once.

    A callback that raises is answered for, by a response of zeros that says why where its type has a `message`.
    """

    def __init__(self, endpoints: NodeEndpoints, name: str, type: str, callback: Callable[[Any], Any]) -> None:
        """Answer requests for the service with absolute `name` by what `callback` returns."""
        self._response = codec.service(type).Response
        self._callback, self._guard = callback, endpoints.guard
        self.responder = Responder(endpoints, name, type, self._answer)

    def close(self) -> None:
        """Stop."""
        self.responder.close()

    def _answer(self, origin: Origin, request: Any) -> None:
        where = f"Service '{self.responder.name}'"
        try:
            body = codec.serialize_as(where, self._callback(request), self._response)
        except Exception as error:  # a user's callback may raise anything
            body = codec.serialize(self._refusal(self._guard.caught(where, error)))
        self.responder.reply(origin, body)

    def _refusal(self, reason: str) -> Any:
        """Return the answer of a service that failed for `reason`, in whose type there may be no room for that."""
        response = self._response()
        if isinstance(getattr(response, "message", None), str):
            response.message = reason
        return response
