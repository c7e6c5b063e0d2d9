"""The GraspGen client against a local server that speaks its protocol, and against all that can be wrong with one."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from golem.capabilities.grasping.base import Gripper
from golem.capabilities.grasping.graspgen import GraspGen, GraspGenConfig, _pack_array, _unpack_array
from golem.errors import ServiceUnavailable

from . import things

zmq = pytest.importorskip("zmq")
msgpack = pytest.importorskip("msgpack")

AHEAD = np.array([1.0, 0.0, 0.0])
HAND = Gripper("right", np.eye(4), -np.pi / 2, AHEAD)


@contextmanager
def server(answer: Callable[[dict[str, Any]], bytes | None]) -> Iterator[int]:
    """Serve one request after the other with the bytes that `answer` makes of it; None gives no answer."""
    context = zmq.Context.instance()
    socket = context.socket(zmq.REP)
    socket.setsockopt(zmq.LINGER, 0)
    port = socket.bind_to_random_port("tcp://127.0.0.1")
    stop = threading.Event()

    def serve() -> None:
        while not stop.is_set():
            if socket.poll(20):
                said = answer(msgpack.unpackb(socket.recv(), object_hook=_unpack_array, raw=False))
                if said is None:
                    return
                socket.send(said)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield port
    finally:
        stop.set()
        thread.join()
        socket.close()


def packed(value: object) -> bytes:
    return msgpack.packb(value, default=_pack_array, use_bin_type=True)


def client(port: int, timeout: float = 2.0) -> GraspGen:
    return GraspGen(GraspGenConfig(host="127.0.0.1", port=port, timeout=timeout))


def their_pose(position: np.ndarray, turn: float = 0.0) -> np.ndarray:
    """Return a pose of GraspGen's: z ahead, x (closing) sideways, turned about the vertical."""
    c, s = np.cos(turn), np.sin(turn)
    T = np.eye(4, dtype=np.float32)
    T[:3, 0], T[:3, 1], T[:3, 2] = (-s, c, 0), (0, 0, 1), (c, s, 0)
    T[:3, 3] = position
    return T


def test_grasps_come_into_our_frame_best_first() -> None:
    bar, asked = things.bar(), []

    def answer(request: dict[str, Any]) -> bytes:
        asked.append(request)
        poses = np.array([their_pose(bar.position - (0.195, 0, 0)), their_pose(bar.position - (0.195, 0, 0), 0.3)] * 2)
        poses[2, :3, 2] *= -1  # from behind
        poses[2, :3, 0] *= -1
        confidences = np.array([0.5, 0.9, 0.95, 0.1], np.float32)
        return packed({"grasps": poses, "confidences": confidences, "num_grasps": 4, "timing": {"infer_ms": 50.0}})

    with server(answer) as port:
        grasps = client(port).propose(bar, bar.points, HAND)
    assert asked[0]["action"] == "infer"
    cloud = asked[0]["point_cloud"]
    assert cloud.dtype == np.float32 and cloud.shape[1] == 3
    assert cloud[:, 0].max() < 0.61  # the door stays here
    assert [round(g.score, 2) for g in grasps] == [0.9, 0.5, 0.1]
    T = grasps[1].T_odom_gripper
    np.testing.assert_allclose(T[:3, 2], [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(np.abs(T[:3, 1]), [0, 1, 0], atol=1e-6)
    np.testing.assert_allclose(T[:3, 0], [0, 0, -1], atol=1e-6)
    np.testing.assert_allclose(T[:3, 3], bar.position, atol=1e-5)
    assert grasps[0].gap <= HAND.max_gap


def test_no_grasps_are_no_grasps() -> None:
    none = {"grasps": np.empty((0, 4, 4), np.float32), "confidences": np.empty(0, np.float32), "num_grasps": 0}
    bar = things.bar()
    with server(lambda _: packed(none)) as port:
        assert client(port).propose(bar, bar.points, HAND) == []


def test_an_empty_cloud_is_not_sent() -> None:
    thing = things.seen(np.zeros((0, 3)), np.zeros(3))
    assert GraspGen(GraspGenConfig(port=1)).propose(thing, thing.points, HAND) == []


POSE = np.eye(4, dtype=np.float32)[None]
ONE = np.ones(1, np.float32)
WRONG = {
    "garbled": (b"\xc1\xc1\xc1", "no msgpack"),
    "no map": (packed([1, 2]), "not a map"),
    "an error": (packed({"error": "CUDA out of memory"}), "refused: CUDA out of memory"),
    "no grasps": (packed({"status": "ok"}), "no grasps"),
    "other shapes": (packed({"grasps": POSE, "confidences": np.ones(2, np.float32)}), r"shape \(1, 4, 4\)"),
    "not finite": (packed({"grasps": POSE * np.nan, "confidences": ONE}), "not finite"),
    "no rotation": (packed({"grasps": 2 * POSE, "confidences": ONE}), "no rotations"),
    "text for grasps": (packed({"grasps": "many", "confidences": ONE}), "no grasps"),
    "a false array": (
        packed({"grasps": {b"nd": True, b"type": "<f4", b"shape": [9, 9], b"data": b"12"}, "confidences": ONE}),
        "no msgpack",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_answer_is_a_sentence(name: str) -> None:
    said, message = WRONG[name]
    bar = things.bar()
    with server(lambda _: said) as port, pytest.raises(ServiceUnavailable, match=message):
        client(port).propose(bar, bar.points, HAND)


def test_a_server_that_dies_in_between_is_a_sentence() -> None:
    bar = things.bar()
    with server(lambda _: None) as port, pytest.raises(ServiceUnavailable, match="no answer within 0.2 s"):
        client(port, timeout=0.2).propose(bar, bar.points, HAND)


def test_no_server_is_a_sentence_and_the_next_call_works() -> None:
    bar = things.bar()
    with server(lambda _: packed({"status": "ok"})) as port:
        pass
    with pytest.raises(ServiceUnavailable, match="choose another grasp method"):
        client(port, timeout=0.1).ask({"action": "health"})
    with server(lambda r: packed({"status": "ok" if r["action"] == "health" else "?"})) as port:
        assert client(port).ask({"action": "health"}) == {"status": "ok"}
    assert bar.label == "handle"
