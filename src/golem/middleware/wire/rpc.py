"""Remote calls on a DDS domain: a service takes calls from `rt/api/<service>/request` and answers on `.../response`.

Everybody who calls a service reads the answers to everybody: an answer belongs to the call whose identity it repeats.
"""

from __future__ import annotations

from golem.middleware.dds.base import Reader, Sample, Writer
from golem.middleware.wire import api
from golem.middleware.wire.api import ApiRequest, Response
from golem.middleware.wire.struct_layout import WireError


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

    def take(self) -> list[ApiRequest]:
        """Return the calls that came since the last time, oldest first."""
        requests: list[ApiRequest] = []
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

    def send(self, request: ApiRequest) -> None:
        """Send a call.

        Raises:
            WireError: it cannot be sent.
        """
        self._writer.write(api.encode_request(request))

    def take(self) -> list[Response]:
        """Return the answers that came since the last time, oldest first, to whomever they are."""
        return [response for sample in self._reader.take() if (response := _response(sample)) is not None]

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
