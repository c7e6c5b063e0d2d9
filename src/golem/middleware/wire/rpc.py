"""Remote calls on a DDS domain: a service takes calls from `rt/api/<service>/request` and answers on `.../response`.

Everybody who calls a service reads the answers to everybody: an answer belongs to the call whose identity it repeats.
"""

from __future__ import annotations

import time

from golem.middleware.dds.base import CALLS, Participant, Reader, Sample, Writer
from golem.middleware.unitree_api import (
    SEND_FAILED,
    TIMEOUT,
    Request,
    Response,
    request_topic,
    response_topic,
)
from golem.middleware.wire import api
from golem.middleware.wire.layout import WireError

_POLL = 0.001
"""How often a call that waits looks for its answer [s]."""


def on_the_wire(topic: str) -> str:
    """Return the DDS name of a topic of the vendor's."""
    return f"rt/{topic}"


def serve(participant: Participant, service: str) -> RpcServer:
    """Join a domain as the server of `service`."""
    # The writer first: a client that sees the reader calls at once.
    responses = participant.writer(on_the_wire(response_topic(service)), api.RESPONSE, CALLS)
    requests = participant.reader(on_the_wire(request_topic(service)), api.REQUEST, CALLS)
    return RpcServer(requests, responses)


def reach(participant: Participant, service: str) -> RpcClient:
    """Join a domain as a client of `service`; finding the server takes a moment."""
    responses = participant.reader(on_the_wire(response_topic(service)), api.RESPONSE, CALLS)
    requests = participant.writer(on_the_wire(request_topic(service)), api.REQUEST, CALLS)
    return RpcClient(requests, responses)


class RpcServer:
    """Offers one service.

    Attributes:
        refused: how many calls were not well-formed; nobody can answer those.
        refusal: what was wrong with the last of them.
    """

    def __init__(self, requests: Reader, responses: Writer) -> None:
        """Take calls from `requests` and answer on `responses`."""
        self.refused, self.refusal = 0, ""
        self._reader, self._writer = requests, responses

    def take(self) -> list[Request]:
        """Return the calls that came since the last time, oldest first."""
        requests: list[Request] = []
        for sample in self._reader.take():
            if sample.alive:
                try:
                    requests.append(api.decode_request(sample.payload))
                except WireError as error:
                    self.refused += 1
                    self.refusal = str(error)
        return requests

    def reply(self, response: Response) -> None:
        """Send an answer. Calls with `noreply` want none.

        Raises:
            WireError: it cannot be sent.
        """
        self._writer.write(api.encode_response(response))

    def close(self) -> None:
        """Stop offering the service."""
        self._reader.close()
        self._writer.close()


class RpcClient:
    """Calls one service."""

    def __init__(self, requests: Writer, responses: Reader) -> None:
        """Call on `requests` and take answers from `responses`."""
        self._writer, self._reader = requests, responses

    @property
    def connected(self) -> bool:
        """Whether somebody offers the service now."""
        return self._writer.matched() > 0 and self._reader.matched() > 0

    def send(self, request: Request) -> None:
        """Send a call.

        Raises:
            WireError: it cannot be sent.
        """
        self._writer.write(api.encode_request(request))

    def take(self) -> list[Response]:
        """Return the answers that came since the last time, oldest first, to whomever they are."""
        return [response for sample in self._reader.take() if (response := _response(sample)) is not None]

    def call(self, api_id: int, parameter: str = "{}", timeout: float = 1.0) -> Response:
        """Call and wait for the answer.

        Args:
            api_id: the function to call.
            parameter: its argument, JSON.
            timeout: time for finding the service and for its answer, together [s].

        Returns:
            The answer, or one that says `SEND_FAILED` if nobody offers the service, `TIMEOUT` if it does not answer.
        """
        deadline = time.monotonic() + timeout
        number = time.monotonic_ns()  # as the vendor's client does: it tells calls of several clients apart
        while not self.connected:
            if time.monotonic() >= deadline:
                return Response(number, api_id, SEND_FAILED)
            time.sleep(_POLL)
        self.send(Request(number, api_id, parameter))
        while True:
            for response in self.take():
                if (response.id, response.api_id) == (number, api_id):
                    return response
            if time.monotonic() >= deadline:
                return Response(number, api_id, TIMEOUT)
            time.sleep(_POLL)

    def close(self) -> None:
        """Leave the domain."""
        self._reader.close()
        self._writer.close()


def _response(sample: Sample) -> Response | None:
    if not sample.alive:
        return None
    try:
        return api.decode_response(sample.payload)
    except WireError:
        return None  # whose call it answers cannot be known; that call times out
