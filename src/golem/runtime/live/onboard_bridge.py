"""The robot's own computer across processes: calls and answers, between a bus and the domain.

A bus holds the newest value of a stream only: calls that arrive together are therefore let onto it one per tick.
"""

from __future__ import annotations

import random
from collections import deque
from dataclasses import replace

from golem.interfaces import topics
from golem.middleware.bus import Bus, News
from golem.middleware.wire.api import ApiRequest, Response, RpcClient, RpcServer
from golem.runtime.executor import Node
from golem.types import TICK

WAITING = 64
"""Calls that may wait for their tick; of more the oldest are dropped [own]."""
_CALLS = 2**16
"""Calls of one client before its identities repeat."""


class CallsIn(Node):
    """Brings calls from the domain to the service on the bus."""

    period = TICK

    def __init__(self, bus: Bus, service: str, server: RpcServer) -> None:
        self._bus, self._topic, self._server = bus, topics.api_request(service), server
        self._waiting: deque[ApiRequest] = deque(maxlen=WAITING)

    def step(self, t: float) -> None:
        self._waiting.extend(self._server.take())
        if self._waiting:
            self._bus.publish(self._topic, self._waiting.popleft(), t)


class AnswersOut(Node):
    """Sends the answers of the service on the bus."""

    period = TICK

    def __init__(self, bus: Bus, service: str, server: RpcServer) -> None:
        self._news, self._server = News(bus, topics.api_response(service)), server

    def step(self, t: float) -> None:
        response = self._news.read()
        if response is not None:
            self._server.reply(response)


class Identities:
    """Tells the calls of one client of a bus from those of every other client of the domain."""

    def __init__(self) -> None:
        """Choose 65536 identities that nobody else is likely to use."""
        self._first = random.SystemRandom().getrandbits(46) * _CALLS

    def outgoing(self, request: ApiRequest) -> ApiRequest:
        """Return `request` as it goes to the domain."""
        return replace(request, id=self._first + request.id % _CALLS)

    def incoming(self, response: Response) -> Response | None:
        """Return `response` as the bus knows its call; None if it answers somebody else's."""
        number = response.id - self._first
        return replace(response, id=number) if 0 <= number < _CALLS else None


class CallsOut(Node):
    """Sends the calls on the bus to a service on the domain; while nobody offers it the newest call waits."""

    period = TICK

    def __init__(self, bus: Bus, service: str, client: RpcClient, identities: Identities) -> None:
        self._news, self._client = News(bus, topics.api_request(service)), client
        self._identities = identities
        self._unsent: ApiRequest | None = None

    def step(self, t: float) -> None:
        self._unsent = self._news.read() or self._unsent
        if self._unsent is not None and self._client.connected:
            self._client.send(self._identities.outgoing(self._unsent))
            self._unsent = None


class AnswersIn(Node):
    """Brings the answers to the calls of `CallsOut` to the bus."""

    period = TICK

    def __init__(self, bus: Bus, service: str, client: RpcClient, identities: Identities) -> None:
        self._bus, self._topic, self._client = bus, topics.api_response(service), client
        self._identities = identities
        self._waiting: deque[Response] = deque(maxlen=WAITING)

    def step(self, t: float) -> None:
        for response in self._client.take():
            own = self._identities.incoming(response)
            if own is not None:
                self._waiting.append(own)
        if self._waiting:
            self._bus.publish(self._topic, self._waiting.popleft(), t)
