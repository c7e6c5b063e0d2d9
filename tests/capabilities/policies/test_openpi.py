from __future__ import annotations

import socket
import time
from typing import Any

import numpy as np
import pytest

pytest.importorskip("websockets")
pytest.importorskip("msgpack")
from tests.capabilities.policies.servers import late, pack, policy_server

from golem.capabilities.policies.openpi import PolicyLinkConfig, PolicyServer
from golem.errors import ConfigError, ServiceUnavailable

SEEN = {
    "observation.state": np.arange(3, dtype=np.float32),
    "prompt": "x",
    "observation.images.head": np.zeros((2, 2, 3), np.uint8),
}


def test_what_is_sent_comes_as_it_is_and_so_does_the_answer() -> None:
    got: list[dict[str, Any]] = []

    def answer(seen: dict[str, Any]) -> Any:
        got.append(seen)
        return np.full((2, 25), 0.5, np.float32)

    with policy_server(answer) as port:
        server = PolicyServer(PolicyLinkConfig(port=port))
        actions = server.infer(SEEN)
        assert actions.dtype == np.float32 and actions.shape == (2, 25) and server.about == {"name": "test"}
        assert np.array_equal(got[0]["observation.state"], SEEN["observation.state"]) and got[0]["prompt"] == "x"
        assert got[0]["observation.images.head"].dtype == np.uint8
        server.infer(SEEN)  # over the same connection
        server.close()
        server.infer(SEEN)  # and over another
        server.close()


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("Traceback ...\nKeyError: 'state'", "failed: KeyError: 'state'"),
        (b"\xc1\xc1", "no msgpack"),
        (pack([1, 2]), "sent a list"),
        (pack({"action": 1}), "no 'actions', but action"),
        (pack({b"__ndarray__": True, b"data": b"12", b"dtype": "|O", b"shape": (1,)}), "no msgpack"),
        (pack({b"__ndarray__": True, b"data": b"123", b"dtype": "<f4", b"shape": (7,)}), "no msgpack"),
    ],
)
def test_nonsense_is_told(said: bytes | str, words: str) -> None:
    with policy_server(lambda seen: said) as port:
        server = PolicyServer(PolicyLinkConfig(port=port))
        with pytest.raises(ServiceUnavailable, match=words):
            server.infer(SEEN)
        server.close()


def test_nobody_is_there() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(ServiceUnavailable, match=rf"127.0.0.1:{port} cannot be reached"):
        PolicyServer(PolicyLinkConfig(port=port)).infer(SEEN)


def test_who_is_late_is_not_waited_for() -> None:
    with policy_server(late(1.0)) as port:
        server, begun = PolicyServer(PolicyLinkConfig(port=port, timeout=0.2)), time.monotonic()
        with pytest.raises(ServiceUnavailable, match="no answer within 0.2 s"):
            server.infer(SEEN)
        assert time.monotonic() - begun < 0.9


def test_who_dies_is_told() -> None:
    def answer(seen: dict[str, Any]) -> Any:
        raise RuntimeError("gone")

    with policy_server(answer) as port:
        with pytest.raises(ServiceUnavailable, match="cannot be reached"):
            PolicyServer(PolicyLinkConfig(port=port)).infer(SEEN)


@pytest.mark.parametrize("wrong", [{"port": 0}, {"timeout": 0.0}, {"latency": -1.0}, {"fps": 0}, {"host": "a/b"}])
def test_options_that_make_no_sense(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        PolicyLinkConfig(**wrong)
