from __future__ import annotations

import random
import threading
from dataclasses import fields
from typing import Any, cast

import numpy as np
import pytest

from golem.errors import ConfigError, MissingExtra

pytest.importorskip("rosbags")

from tests.middleware.ros.samples import random_message, travelling

from golem.middleware.ros import codec
from golem.middleware.ros.codec import Codec
from golem.middleware.ros.definitions import EMPTY_MEMBER
from golem.middleware.ros.message import CodecError, Message, python_name
from golem.middleware.ros.msgs.geometry_msgs import Quaternion, Twist, Vector3
from golem.middleware.ros.msgs.golem_interfaces import HandState, Pick_Goal, SafetyStatus
from golem.middleware.ros.msgs.sensor_msgs import Image, JointState
from golem.middleware.ros.msgs.std_msgs import String


def test_a_twist_is_written_as_six_doubles_behind_the_encapsulation_header() -> None:
    payload = codec.serialize(Twist(Vector3(1.0, 2.0, 3.0), Vector3(4.0, 5.0, 6.0)))
    assert payload == b"\x00\x01\x00\x00" + np.arange(1.0, 7.0).tobytes()


def test_a_string_is_written_with_its_length_and_a_zero_and_padded_to_four_bytes() -> None:
    assert codec.serialize(String("golem")) == b"\x00\x01\x00\x00" + b"\x06\x00\x00\x00golem\x00" + b"\x00\x00"


def test_a_big_endian_payload_is_read() -> None:
    payload = b"\x00\x00\x00\x00" + np.arange(1.0, 7.0, dtype=">f8").tobytes()
    assert codec.deserialize(payload, Twist).angular == Vector3(4.0, 5.0, 6.0)


@pytest.mark.parametrize("name", travelling(codec.codec()))
def test_every_type_survives_the_way_through_its_bytes(name: str) -> None:
    rng = random.Random(name)
    for _ in range(3):
        message = random_message(codec.codec(), name, rng)
        payload = codec.serialize(message)
        assert len(payload) % 4 == 0
        assert codec.deserialize(payload, type(message)) == message


def test_the_official_reader_and_writer_agree_by_the_definitions_we_give() -> None:
    # mcap_ros2 has a parser of definitions and a CDR codec of its own: what it reads must say what we meant, and
    # what it writes then must be what we wrote.
    dynamic = pytest.importorskip("mcap_ros2._dynamic")
    known = codec.codec()
    for name in travelling(known):
        message = random_message(known, name, random.Random(name))
        package, _, stem = name.split("/")
        plain = f"{package}/{stem.replace('_', '')}"  # it takes no '_FeedbackMessage' for the name of a type
        payload, definition = codec.serialize(message), known.definition(name)
        decoded = dynamic.generate_dynamic(plain, definition)[plain](payload)
        _same(message, decoded, name)
        written = dynamic.serialize_dynamic(plain, definition)[plain](decoded)
        assert written + bytes(-len(written) % 4) == payload, name


def _same(ours: Any, theirs: Any, where: str) -> None:
    if isinstance(ours, Message):
        for field in fields(cast(Any, ours)):
            if field.name != EMPTY_MEMBER:
                _same(getattr(ours, field.name), getattr(theirs, field.name), f"{where}.{field.name}")
    elif isinstance(ours, list):
        for k, pair in enumerate(zip(ours, theirs, strict=True)):
            _same(pair[0], pair[1], f"{where}[{k}]")
    elif isinstance(ours, np.ndarray):
        values = np.frombuffer(theirs, ours.dtype) if isinstance(theirs, bytes) else np.asarray(theirs)
        assert np.array_equal(ours, values.astype(ours.dtype)), where
    elif where.startswith(("std_msgs/msg/Byte", "diagnostic_msgs")) and isinstance(ours, int):
        assert ours % 256 == (theirs[0] if isinstance(theirs, bytes) else int(theirs)) % 256, where
    else:
        assert ours == theirs, where


def test_arrays_of_a_received_message_are_views_that_nobody_can_write() -> None:
    payload = codec.serialize(Image(height=1, width=4, encoding="mono8", step=4, data=np.arange(4, dtype=np.uint8)))
    data = codec.deserialize(payload, Image).data
    assert data.base is not None and not data.flags.writeable


def test_a_large_message_leaves_nothing_behind_in_the_next_ones_padding() -> None:
    full = Image(encoding="rgb8", data=np.full(100_000, 255, np.uint8))
    empty = Image(encoding="rgb8", data=np.zeros(100_000, np.uint8))
    before = codec.serialize(empty)
    codec.serialize(full)
    assert codec.serialize(empty) == before


def test_threads_do_not_disturb_each_other() -> None:
    wrong: list[int] = []

    def work(value: int) -> None:
        message = Image(data=np.full(100_000, value, np.uint8))
        for _ in range(30):
            if not np.all(codec.deserialize(codec.serialize(message), Image).data == value):
                wrong.append(value)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


@pytest.mark.parametrize(
    "position",
    [[0.0, 1.0], np.zeros(2, np.float32), np.zeros((2, 2)), np.zeros(4)[::2], np.arange(3), None],
    ids=["list", "float32", "two-dimensional", "strided", "int64", "none"],
)
def test_an_array_of_another_kind_is_refused_by_name(position: object) -> None:
    with pytest.raises(CodecError, match="'position' of a sensor_msgs/msg/JointState must be a contiguous"):
        codec.serialize(JointState(position=position))  # type: ignore[arg-type]


def test_a_fixed_array_of_another_length_is_refused() -> None:
    with pytest.raises(CodecError, match="golem_interfaces/msg/HandState"):
        codec.serialize(HandState(force=np.zeros(3)))


@pytest.mark.parametrize(
    "message",
    [Twist(linear=3), String(7), SafetyStatus(state=None), Twist(Vector3("fast", 0.0, 0.0))],  # type: ignore[arg-type]
)
def test_a_field_of_another_type_is_refused(message: Twist | String | SafetyStatus) -> None:
    with pytest.raises(CodecError, match="cannot be serialised"):
        codec.serialize(message)


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"\x00\x01\x00",
        b"\x00\x01\x00\x00",
        b"\x00\x03\x00\x00" + bytes(48),  # PL_CDR
        b"\x00\x07\x00\x00" + bytes(48),  # XCDR2
        b"\x00\x01\x00\x00" + bytes(47),
        b"\x00\x01\x00\x00" + bytes(56),
    ],
)
def test_bytes_that_are_no_twist_are_refused(payload: bytes) -> None:
    with pytest.raises(CodecError, match="no geometry_msgs/msg/Twist"):
        codec.deserialize(payload, Twist)


def test_names_on_the_wire() -> None:
    assert codec.dds_name("sensor_msgs/msg/Image") == "sensor_msgs::msg::dds_::Image_"
    assert codec.dds_name(Pick_Goal) == "golem_interfaces::action::dds_::Pick_Goal_"


def test_a_service_has_its_two_messages() -> None:
    service = codec.service("std_srvs/srv/SetBool")
    assert service.Request(True).data is True
    assert service.Response(True, "done").message == "done"


def test_an_action_has_everything_that_rosidl_derives() -> None:
    pick = codec.action("golem_interfaces/action/Pick")
    assert pick.Goal is Pick_Goal
    request = pick.SendGoal.Request()
    assert list(request.goal_id.uuid) == [0] * 16 and request.goal == Pick_Goal()
    assert pick.SendGoal.Response().accepted is False
    assert pick.GetResult.Response(4).status == 4
    assert pick.FeedbackMessage().feedback == pick.Feedback()
    assert codec.dds_name(pick.GetResult.Request) == "golem_interfaces::action::dds_::Pick_GetResult_Request_"


def test_unknown_names_are_answered_with_near_ones() -> None:
    with pytest.raises(ConfigError, match="Did you mean 'std_srvs/srv/SetBool'"):
        codec.service("std_srvs/srv/SetBol")
    with pytest.raises(ConfigError, match="Unknown ROS package 'sensor_msg'.*Did you mean 'sensor_msgs'"):
        codec.message("sensor_msg/msg/Image")
    with pytest.raises(ConfigError, match="Unknown ROS 2 distribution 'humbel'.*Did you mean 'humble'"):
        Codec("humbel")


def test_distributions_differ_in_the_gid() -> None:
    for distro, size in (("humble", 24), ("jazzy", 16)):
        known = codec.codec(distro)
        gid = known.message("rmw_dds_common/msg/Gid")()
        assert len(gid.data) == size and len(known.serialize(gid)) == 4 + size


def test_the_generated_classes_fit_every_distribution() -> None:
    for distro in ("humble", "jazzy"):
        known = codec.codec(distro)
        for name in travelling(known):
            kind = known.message(name)
            wanted = [python_name(field) for field, _ in known._types[name][1]]
            assert [field.name for field in fields(kind)] == wanted, (distro, name)


def test_messages_are_equal_by_their_fields() -> None:
    assert HandState(gap=0.1) == HandState(gap=0.1)
    assert HandState(force=np.ones(2)) != HandState()
    assert Vector3() != Quaternion()
    assert Quaternion().w == 1.0


def test_without_rosbags_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "rosbags.typesys", None)
    with pytest.raises(MissingExtra, match=r"golem-humanoid\[dds\]"):
        Codec("jazzy")
