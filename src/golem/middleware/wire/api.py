"""unitree_api: remote calls and their answers, and both as CDR.

Calls travel on `rt/api/<service>/request`, answers on `.../response`. An answer repeats the identity (id, api_id) of
its call and carries a status code, 0 for success. Members and types: unitree_sdk2_python,
unitree_sdk2py/idl/unitree_api/msg/dds_. Both end in a string and a sequence of bytes, so that their size varies. A
length that a payload claims is compared with what is there before anything is done with it.

Everybody who calls a service reads the answers to everybody: an answer belongs to the call whose identity it repeats.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from golem.middleware.dds.base import ENCAPSULATION, Payload, Reader, Sample, Writer
from golem.middleware.wire.struct_layout import WireError, check_encapsulation


class RpcServer:
    """Offers one service; `refused` counts calls that were not well-formed, `refusal` is about the last."""

    def __init__(self, requests: Reader, responses: Writer) -> None:
        self.refused, self.refusal = 0, ""
        self._reader, self._writer = requests, responses

    def take(self) -> list[ApiRequest]:
        """Return the calls that came since the last time, oldest first."""
        requests: list[ApiRequest] = []
        for sample in self._reader.take():
            if sample.alive:
                try:
                    requests.append(decode_request(sample.payload))
                except WireError as error:
                    self.refused += 1
                    self.refusal = str(error)
        return requests

    def reply(self, response: Response) -> None:
        """Send an answer. Calls with `noreply` want none. Raises WireError: it cannot be sent."""
        self._writer.write(encode_response(response))

    def close(self) -> None:
        """Stop offering the service."""
        self._reader.close()
        self._writer.close()


class RpcClient:
    """Calls one service."""

    def __init__(self, requests: Writer, responses: Reader) -> None:
        self._writer, self._reader = requests, responses

    @property
    def connected(self) -> bool:
        """Whether somebody offers the service now."""
        return self._writer.matched() > 0 and self._reader.matched() > 0

    def send(self, request: ApiRequest) -> None:
        """Send a call. Raises WireError: it cannot be sent."""
        self._writer.write(encode_request(request))

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
        return decode_response(sample.payload)
    except WireError:
        return None  # whose call it answers cannot be known; that call times out


REQUEST: Final = "unitree_api::msg::dds_::Request_"
RESPONSE: Final = "unitree_api::msg::dds_::Response_"
MAX_SIZE = 1 << 20
"""Bytes of the largest payload that is accepted [own: the vendor's calls have some hundred]."""

_REQUEST_HEADER = struct.Struct("<qqqiB")  # id, api_id, lease, priority, noreply
_RESPONSE_HEADER = struct.Struct("<qqi")  # id, api_id, code
_LENGTH = struct.Struct("<I")
_PADDING = 3
"""Bytes that may follow a message: payloads are multiples of four."""


@dataclass(frozen=True, slots=True)
class ApiRequest:
    """A call.

    Attributes:
        id: tells the calls of one client apart.
        api_id: the function that is called.
        parameter: its argument, JSON; empty where it takes none.
        lease: number of the lease it is made under; 0 without.
        priority: a higher one goes first where the service has a queue for it.
        noreply: whether no answer is wanted.
        binary: an argument that is no JSON.
    """

    id: int
    api_id: int
    parameter: str = ""
    lease: int = 0
    priority: int = 0
    noreply: bool = False
    binary: bytes = b""


@dataclass(frozen=True, slots=True)
class Response:
    """The answer to a call.

    Attributes:
        id, api_id: those of the request.
        code: status, 0 for success.
        data: the result, JSON; empty where there is none.
        binary: a result that is no JSON.
    """

    id: int
    api_id: int
    code: int = 0
    data: str = ""
    binary: bytes = b""


def request_topic(service: str) -> str:
    """Return the topic of `ApiRequest` to a service."""
    return f"api/{service}/request"


def response_topic(service: str) -> str:
    """Return the topic of `Response` from a service."""
    return f"api/{service}/response"


def encode_request(request: ApiRequest) -> bytes:
    """Return `request` as a `Request_`. Raises WireError: a number is out of range, or the text cannot be sent."""
    r = request
    header = _pack(_REQUEST_HEADER, REQUEST, r.id, r.api_id, r.lease, r.priority, r.noreply)
    return _encode(header, r.parameter, r.binary, REQUEST)


def decode_request(payload: Payload) -> ApiRequest:
    """Return the call in a `Request_`. Raises WireError: it is not well-formed."""
    numbers, text, binary = _decode(payload, _REQUEST_HEADER, REQUEST)
    number, api_id, lease, priority, noreply = numbers
    if noreply not in (0, 1):
        raise WireError(f"The noreply of a {REQUEST} is {noreply}; a boolean is 0 or 1.")
    return ApiRequest(number, api_id, text, lease, priority, bool(noreply), binary)


def encode_response(response: Response) -> bytes:
    """Return `response` as a `Response_`. Raises WireError: a number is out of range, or the text cannot be sent."""
    header = _pack(_RESPONSE_HEADER, RESPONSE, response.id, response.api_id, response.code)
    return _encode(header, response.data, response.binary, RESPONSE)


def decode_response(payload: Payload) -> Response:
    """Return the answer in a `Response_`. Raises WireError: it is not well-formed."""
    (number, api_id, code), text, binary = _decode(payload, _RESPONSE_HEADER, RESPONSE)
    return Response(number, api_id, code, text, binary)


def _pack(layout: struct.Struct, type_name: str, *numbers: int) -> bytes:
    try:
        return layout.pack(*numbers)
    except struct.error as error:
        raise WireError(f"A {type_name} cannot say {numbers}: {error}.") from error


def _align(offset: int) -> int:
    return -(-offset // 4) * 4


def _encode(header: bytes, text: str, binary: bytes, type_name: str) -> bytes:
    """Return a payload: header, string, sequence of bytes."""
    try:
        string = text.encode()
    except UnicodeEncodeError as error:
        raise WireError(f"The text of a {type_name} is no Unicode: {error}.") from error
    if b"\0" in string:
        raise WireError(f"The text of a {type_name} has a NUL character, which ends a string.")
    body = bytearray(ENCAPSULATION + header)
    for count, data in ((len(string) + 1, string + b"\0"), (len(binary), binary)):
        body += bytes(_align(len(body)) - len(body)) + _LENGTH.pack(count) + data
    if len(body) > MAX_SIZE:
        raise WireError(f"A {type_name} of {len(body)} bytes is too long; the most is {MAX_SIZE}.")
    return bytes(body)


def _decode(payload: Payload, header: struct.Struct, type_name: str) -> tuple[tuple[int, ...], str, bytes]:
    """Return the numbers of the header, the string and the sequence of bytes."""
    check_encapsulation(payload, type_name)
    if len(payload) > MAX_SIZE:
        raise WireError(f"A {type_name} of {len(payload)} bytes is too long; the most is {MAX_SIZE}.")
    start = len(ENCAPSULATION)
    if len(payload) < start + header.size:
        raise WireError(f"A {type_name} of {len(payload)} bytes is too short.")
    numbers = header.unpack_from(payload, start)
    string, end = _counted(payload, start + header.size, type_name)
    binary, end = _counted(payload, end, type_name)
    if len(payload) - end > _PADDING:
        raise WireError(f"A {type_name} has {len(payload) - end} bytes behind its end.")
    if not string or string.find(b"\0") != len(string) - 1:
        raise WireError(f"The string of a {type_name} does not end with its only NUL character.")
    try:
        return numbers, string[:-1].decode(), binary
    except UnicodeDecodeError as error:
        raise WireError(f"The string of a {type_name} is not UTF-8: {error}.") from error


def _counted(payload: Payload, offset: int, type_name: str) -> tuple[bytes, int]:
    """Return the bytes behind the length that stands at the next multiple of four from `offset`, and where they end."""
    start = _align(offset) + _LENGTH.size
    if start > len(payload):
        raise WireError(f"A {type_name} of {len(payload)} bytes is too short.")
    (count,) = _LENGTH.unpack_from(payload, start - _LENGTH.size)
    if count > len(payload) - start:
        raise WireError(f"A {type_name} claims {count} bytes where {len(payload) - start} are left.")
    return bytes(payload[start : start + count]), start + count
