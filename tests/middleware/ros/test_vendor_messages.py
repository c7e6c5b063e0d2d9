"""The vendor's messages as .msg files say the same as their images in `wire`, which know nothing of the files."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags")

from tests.middleware.ros.samples import random_message
from tests.middleware.wire import go

from golem.middleware.ros import codec
from golem.middleware.ros.msgs import unitree_api
from golem.middleware.wire import api, hg
from golem.middleware.wire.api import ApiRequest, Response
from golem.middleware.wire.struct_layout import StructLayout

IMU = ("quaternion", "gyroscope", "accelerometer", "rpy", "temperature")
STATE = ("q", "dq", "ddq", "tau_est", "temperature", "vol", "sensor", "motorstate", "reserve")
COMMAND = ("q", "dq", "tau", "kp", "kd", "reserve")


def image(layout: StructLayout, name: str, seed: int) -> tuple[Any, Any]:
    """Return a random message of type `name`, and its image."""
    message = random_message(codec.codec(), name, random.Random(seed))
    assert layout.type_name == codec.dds_name(name)
    return message, layout.read(codec.serialize(message))


def same(message: Any, image: Any, fields: tuple[str, ...]) -> None:
    for field in fields:
        np.testing.assert_array_equal(np.asarray(getattr(message, field)), image[field], field)


@pytest.mark.parametrize("seed", range(5))
def test_low_state(seed: int) -> None:
    message, read = image(hg.LOW_STATE, "unitree_hg/msg/LowState", seed)
    same(message, read, ("version", "mode_pr", "mode_machine", "tick", "wireless_remote", "reserve", "crc"))
    same(message.imu_state, read["imu"], IMU)
    for motor, its in zip(message.motor_state, read["motor"], strict=True):
        same(motor, its, STATE)
    modes = [int(read["first_mode"]), *read["motor"]["mode"][1:].tolist()]
    assert modes == [motor.mode for motor in message.motor_state]


@pytest.mark.parametrize("seed", range(5))
def test_low_cmd(seed: int) -> None:
    message, read = image(hg.LOW_CMD, "unitree_hg/msg/LowCmd", seed)
    same(message, read, ("mode_pr", "mode_machine", "reserve", "crc"))
    for motor, its in zip(message.motor_cmd, read["motor"], strict=True):
        same(motor, its, COMMAND)
    modes = [int(read["first_mode"]), *read["motor"]["mode"][1:].tolist()]
    assert modes == [motor.mode for motor in message.motor_cmd]


def test_imu_state() -> None:
    message, read = image(hg.IMU_STATE, "unitree_hg/msg/IMUState", 0)
    same(message, read, IMU)


def test_sport_mode_state() -> None:
    message, read = image(go.SPORT_MODE_STATE, "unitree_go/msg/SportModeState", 0)
    same(message, read, ("error_code", "mode", "progress", "position", "velocity", "yaw_speed", "foot_force"))
    same(message, read, ("foot_position_body", "foot_speed_body", "range_obstacle", "body_height"))
    same(message.path_point[9], read["path_point"][9], ("t_from_start", "x", "vyaw"))
    assert message.imu_state.temperature % 256 == read["imu"]["temperature"]


def test_requests() -> None:
    sent = unitree_api.Request(parameter='{"data": 1}')
    sent.header.identity = unitree_api.RequestIdentity(7, 1001)
    assert api.decode_request(codec.serialize(sent)) == ApiRequest(7, 1001, '{"data": 1}')
    read = codec.deserialize(api.encode_request(ApiRequest(8, 1003, "{}")), unitree_api.Request)
    assert (read.header.identity.id, read.header.identity.api_id, read.parameter) == (8, 1003, "{}")


def test_responses() -> None:
    sent = unitree_api.Response(data="ø")
    sent.header.identity = unitree_api.RequestIdentity(7, 1001)
    sent.header.status.code = 3203
    assert api.decode_response(codec.serialize(sent)) == Response(7, 1001, 3203, "ø")
    read = codec.deserialize(api.encode_response(Response(8, 1003, -1, "{}")), unitree_api.Response)
    assert (read.header.identity.id, read.header.status.code, read.data) == (8, -1, "{}")
