from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.middleware.wire import api
from golem.middleware.wire.api import ApiRequest, Response
from golem.middleware.wire.struct_layout import WireError

int32 = st.integers(-(2**31), 2**31 - 1)
int64 = st.integers(-(2**63), 2**63 - 1)
text = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=30)
binary = st.binary(max_size=9)
requests = st.builds(ApiRequest, int64, int64, text, int64, int32, st.booleans(), binary)
responses = st.builds(Response, int64, int64, int32, text, binary)


@given(requests, st.integers(0, 3))
def test_a_request_survives_the_wire(request: ApiRequest, padding: int) -> None:
    assert api.decode_request(api.encode_request(request) + bytes(padding)) == request


@given(responses, st.integers(0, 3))
def test_a_response_survives_the_wire(response: Response, padding: int) -> None:
    assert api.decode_response(api.encode_response(response) + bytes(padding)) == response


def test_bytes_are_those_of_the_sdk() -> None:
    # unitree_sdk2_python: Request_(..., 'hallo', [1, 2, 3]).serialize()
    golden = struct.pack("<4sqqqi?3xI6s2xI3s", b"\0\1\0\0", 1, 2, 3, 4, True, 6, b"hallo\0", 3, b"\1\2\3")
    assert api.encode_request(ApiRequest(1, 2, "hallo", 3, 4, True, b"\1\2\3")) == golden


GOOD = api.encode_request(ApiRequest(1, 2, "{}", 0, 0, False, b"\5"))
BOOLEAN, STRING, TEXT, SEQUENCE = 4 + 28, 4 + 32, 4 + 36, 4 + 40


@pytest.mark.parametrize(
    ("offset", "new", "words"),
    [
        (0, b"\0\0", "little-endian"),
        (BOOLEAN, b"\2", "boolean"),
        (STRING, b"\xff\xff\xff\xff", "claims 4294967295 bytes"),
        (STRING, b"\0\0\0\0", "claims 32123 bytes"),
        (STRING, b"\2\0\0\0", "NUL"),
        (TEXT, b"\0", "NUL"),
        (TEXT, b"\xff", "UTF-8"),
        (SEQUENCE, b"\2\0\0\0", "claims 2 bytes where 1 are left"),
    ],
)
def test_a_malformed_request_is_refused(offset: int, new: bytes, words: str) -> None:
    damaged = bytearray(GOOD)
    damaged[offset : offset + len(new)] = new
    with pytest.raises(WireError, match=words):
        api.decode_request(damaged)


def test_a_payload_of_another_length_is_refused() -> None:
    for length in range(len(GOOD)):
        with pytest.raises(WireError):
            api.decode_request(GOOD[:length])
    with pytest.raises(WireError, match="behind its end"):
        api.decode_request(GOOD + bytes(4))
    with pytest.raises(WireError, match="too long"):
        api.decode_request(GOOD + bytes(api.MAX_SIZE))


@pytest.mark.parametrize(
    "request_",
    [
        ApiRequest(2**63, 1),
        ApiRequest(1, 1, priority=2**31),
        ApiRequest(1, 1, "a\0b"),
        ApiRequest(1, 1, "\ud800"),
        ApiRequest(1, 1, "x" * api.MAX_SIZE),
    ],
)
def test_what_would_be_refused_is_not_sent(request_: ApiRequest) -> None:
    with pytest.raises(WireError):
        api.encode_request(request_)
    if request_.priority == 0:
        with pytest.raises(WireError):
            api.encode_response(Response(request_.id, 1, 0, request_.parameter))
