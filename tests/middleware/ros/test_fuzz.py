"""Whatever arrives from a network ends in a message or in a `CodecError`, with bounded memory."""

from __future__ import annotations

import random
import struct
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags")

from tests.middleware.ros.samples import mutated, random_message, travelling

from golem.interfaces import images, public
from golem.interfaces.images import to_lens
from golem.interfaces.ros_convert import (
    to_base_estimate,
    to_gate_status,
    to_hand_command,
    to_hand_state,
    to_twist,
    transforms,
)
from golem.middleware.ros import codec
from golem.middleware.ros.message import CodecError
from golem.robots.sensors.calibration import OPTICAL_FRAMES, calibrations
from golem.robots.sensors.cameras import HEAD

READ: dict[str, tuple[Callable[[Any], object], ...]] = {
    "geometry_msgs/msg/Twist": (to_twist,),
    "golem_interfaces/msg/BaseEstimate": (to_base_estimate,),
    "golem_interfaces/msg/HandState": (to_hand_state,),
    "golem_interfaces/msg/HandCommand": (to_hand_command,),
    "golem_interfaces/msg/SafetyStatus": (to_gate_status,),
    "sensor_msgs/msg/CameraInfo": (lambda message: to_lens(message, "head", 0.1, 3.0, 15.0),),
    "sensor_msgs/msg/Image": (images.to_rgb, images.to_depth),
    "sensor_msgs/msg/PointCloud2": (images.to_points,),
    "tf2_msgs/msg/TFMessage": (calibrations,),
}
"""What reads a message further, by type."""
SOUND = {
    "sensor_msgs/msg/Image": [
        images.color_image(0.0, np.zeros((4, 6, 3), np.uint8), "camera"),
        images.depth_image(0.0, np.ones((4, 6), np.float32), "camera"),
    ],
    "sensor_msgs/msg/CameraInfo": [images.camera_info(0.0, HEAD, "camera")],
    "sensor_msgs/msg/PointCloud2": [images.point_cloud(0.0, np.zeros(8, images.LIVOX_POINT), "lidar_link")],
    "tf2_msgs/msg/TFMessage": [
        transforms(0.0, [(OPTICAL_FRAMES["head"], public.optical_frame("head"))], np.eye(4)[np.newaxis])
    ],
}
"""Messages whose fields must agree, which random ones do not."""
PER_BYTE = 128
"""Bytes that a decoder may take for each byte of payload: the dearest element is a message with an empty array, 344
bytes for four."""


def attack(name: str, count: int, rng: random.Random) -> tuple[int, int]:
    """Decode `count` mutated payloads of type `name`; return how many were taken for messages, and how many not."""
    known = codec.codec()
    kind = known.message(name)
    taken = refused = 0
    understood: set[Callable[[Any], object]] = set()
    while taken + refused < count:
        sound = rng.choice(SOUND[name]) if name in SOUND else random_message(known, name, rng)
        payload = known.serialize(sound)
        for _ in range(20):
            try:
                message = known.deserialize(mutated(payload, rng), kind)
            except CodecError:
                refused += 1
                continue
            for read in READ.get(name, ()):
                with suppress(CodecError):
                    read(message)
                    understood.add(read)
            taken += 1
    assert len(understood) == len(READ.get(name, ())) or count < 400, "a reader took nothing for sound"
    return taken, refused


def test_mutated_payloads_of_every_type() -> None:
    rng = random.Random(4)
    totals = [attack(name, 20, rng) for name in travelling(codec.codec())]
    assert all(sum(column) > 500 for column in zip(*totals, strict=True))


@pytest.mark.parametrize("name", sorted(READ))
def test_mutated_payloads_of_types_that_are_read_further(name: str) -> None:
    taken, refused = attack(name, 400, random.Random(name))
    assert taken > 0 and refused > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(READ))
def test_a_hundred_thousand_mutated_payloads_of_each_type_that_is_read_further(name: str) -> None:
    taken, refused = attack(name, 100_000, random.Random(name))
    assert taken > 0 and refused > 0


@pytest.mark.slow
@pytest.mark.long
def test_half_a_million_mutated_payloads() -> None:
    rng = random.Random(500_000)
    names = travelling(codec.codec())
    totals = [attack(name, 500_000 // len(names) + 20, rng) for name in names]
    assert sum(map(sum, totals)) >= 500_000


def test_counts_that_promise_more_than_there_is_take_no_memory() -> None:
    known = codec.codec()
    for name in travelling(known):
        kind = known.message(name)
        for count in (64, 1 << 16, 1 << 30, 0xFFFFFFFF):
            payload = b"\x00\x01\x00\x00" + struct.pack("<I", count) * 256
            assert _peak(payload, kind) < PER_BYTE * len(payload) + 8192, name


def test_sequences_of_the_smallest_elements_take_memory_in_proportion() -> None:
    known = codec.codec()
    for name in travelling(known):
        empty = known.message(name)()
        for field in empty.__dataclass_fields__:
            value = getattr(empty, field)
            if isinstance(value, list) and not value:
                setattr(empty, field, _many(known, name, field))
                payload = known.serialize(empty)
                assert _peak(payload, type(empty)) < PER_BYTE * len(payload) + 8192, f"{name}.{field}"


def _many(known: codec.Codec, name: str, field: str) -> list[object]:
    """Return 60 of the smallest elements of a sequence."""
    (kind,) = (kind for each, kind in known._types[name][1] if each == field)
    element = kind[1][0]
    return [""] * 60 if element[0] == 1 else [known.message(element[1])() for _ in range(60)]


def _peak(payload: bytes, kind: type) -> int:
    """Return the most bytes that decoding held at a time."""
    try:
        codec.deserialize(payload, kind)  # compile first
    except CodecError:
        pass
    tracemalloc.start()
    try:
        message = codec.deserialize(payload, kind)
        del message
    except CodecError:
        pass
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak
