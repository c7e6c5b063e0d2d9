"""Bytes and checksums against the vendor's own Python SDK.

The hashes below are of messages that the SDK serialised to the same bytes; a run with GOLEM_UNITREE_SDK set to a
checkout of unitree_sdk2_python (tried: commit 37116c5) compares them again, with more messages and both ways.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from tests.middleware.wire import random_images, samples

from golem.middleware.wire import api, convert, hg
from golem.middleware.wire.api import ApiRequest, Response

COUNT = 1000
HASHED = 20
HASHES = {
    "LowState": "0606ffea98b5cb246ec0275a5269c0148452a60e6b32ccb87fb76805c02f5721",
    "LowCmd": "79a68ec39fed98e4c3569666645e88510eaac738a63ad1298d7f3f1aed0c4b7f",
    "IMUState": "ab4e6db9b93197085e21aae18c106059be049fc5412330e78a40ed6f684700a7",
    "SportModeState": "57f78554452c7237e31a9434eb21f3ae91ca725bf36623c607bdae7ce7269539",
}


@pytest.fixture(scope="module")
def sdk() -> SimpleNamespace:
    path = os.environ.get("GOLEM_UNITREE_SDK")
    if not path:
        pytest.skip("GOLEM_UNITREE_SDK does not name a checkout of unitree_sdk2_python")
    pytest.importorskip("cyclonedds")
    sys.path.insert(0, path)
    try:
        idl = "unitree_sdk2py.idl.unitree"
        return SimpleNamespace(
            hg=importlib.import_module(f"{idl}_hg.msg.dds_"),
            go=importlib.import_module(f"{idl}_go.msg.dds_"),
            api=importlib.import_module(f"{idl}_api.msg.dds_"),
            crc=importlib.import_module("unitree_sdk2py.utils.crc").CRC().Crc,
        )
    finally:
        sys.path.remove(path)


@pytest.mark.parametrize("name", random_images.MESSAGES)
def test_bytes_are_those_the_sdk_agreed_with(name: str) -> None:
    layout, rng = random_images.MESSAGES[name][0], np.random.default_rng(0)
    digest = hashlib.sha256()
    for _ in range(HASHED):
        digest.update(random_images.payload(layout, rng))
    assert digest.hexdigest() == HASHES[name]


@pytest.mark.slow
@pytest.mark.parametrize("name", random_images.MESSAGES)
def test_the_sdk_writes_and_reads_the_same_bytes(name: str, sdk: SimpleNamespace) -> None:
    layout, as_sdk, checksum = random_images.MESSAGES[name]
    rng = np.random.default_rng(0)
    for _ in range(COUNT):
        payload = random_images.payload(layout, rng)
        theirs = as_sdk(sdk, layout.read(payload))
        assert theirs.serialize() == payload
        again = type(theirs).deserialize(payload)
        if name == "LowState":
            again.wireless_remote = list(again.wireless_remote)  # which the SDK reads as bytes
        assert again == theirs
        assert layout.type_name == theirs.__idl_typename__.replace(".", "::")
        if checksum is not None:
            assert sdk.crc(theirs) == checksum.of(payload)


@pytest.mark.slow
def test_the_sdk_understands_states_and_accepts_their_checksum(sdk: SimpleNamespace) -> None:
    rng = np.random.default_rng(1)
    for _ in range(COUNT):
        state = samples.state(rng)
        theirs = sdk.hg.LowState_.deserialize(convert.encode_low_state(state, 6))
        assert sdk.crc(theirs) == theirs.crc
        assert (theirs.mode_machine, theirs.tick) == (6, round(state.t * 1000.0))
        motors = theirs.motor_state
        assert [m.q for m in motors] == [*state.q, *[0.0] * 8]
        assert [m.dq for m in motors[:27]] == list(state.dq)
        assert [m.tau_est for m in motors[:27]] == list(state.tau)
        assert [m.mode for m in motors] == [1] * 27 + [0] * 8
        assert list(theirs.imu_state.quaternion) == list(state.imu.quat)
        assert list(theirs.imu_state.gyroscope) == list(state.imu.gyro)
        assert list(theirs.imu_state.accelerometer) == list(state.imu.acc)


@pytest.mark.slow
def test_commands_of_the_sdk_are_accepted_and_understood(sdk: SimpleNamespace) -> None:
    rng = np.random.default_rng(2)
    for _ in range(COUNT):
        command = samples.command(rng)
        columns = np.stack([command.q, command.dq, command.tau, command.kp, command.kd], axis=1).tolist()
        motors = [sdk.hg.MotorCmd_(1, *row, 0) for row in columns]
        motors += [sdk.hg.MotorCmd_(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)] * 8
        theirs = sdk.hg.LowCmd_(hg.PR, 6, motors, [0] * 4, 0)
        theirs.crc = sdk.crc(theirs)
        payload = theirs.serialize()
        assert convert.encode_low_command(command, 6) == payload
        got = convert.decode_low_command(payload, 0.0, 6)
        for name in ("q", "dq", "tau", "kp", "kd"):
            np.testing.assert_array_equal(getattr(got, name), getattr(command, name))


@pytest.mark.slow
def test_calls_and_answers_are_the_sdks(sdk: SimpleNamespace) -> None:
    rng, a = np.random.default_rng(3), sdk.api
    for _ in range(COUNT):
        one, two, three = (int(n) for n in rng.integers(-(2**63), 2**63 - 1, 3))
        priority, noreply = int(rng.integers(-(2**31), 2**31)), bool(rng.integers(2))
        text = "".join(chr(c) for c in rng.integers(1, 0x2FFF, rng.integers(0, 30)))
        binary = rng.bytes(int(rng.integers(0, 9)))
        identity = a.RequestIdentity_(one, two)
        header = a.RequestHeader_(identity, a.RequestLease_(three), a.RequestPolicy_(priority, noreply))
        theirs = a.Request_(header, text, list(binary))
        request = ApiRequest(one, two, text, three, priority, noreply, binary)
        assert theirs.serialize() == api.encode_request(request)
        assert api.decode_request(theirs.serialize()) == request
        assert a.Request_.deserialize(api.encode_request(request)) == theirs
        answer = a.Response_(a.ResponseHeader_(identity, a.ResponseStatus_(priority)), text, list(binary))
        response = Response(one, two, priority, text, binary)
        assert answer.serialize() == api.encode_response(response)
        assert api.decode_response(answer.serialize()) == response
        assert a.Response_.deserialize(api.encode_response(response)) == answer
