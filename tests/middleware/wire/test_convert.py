from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.middleware.wire import go, random_images, samples

from golem.middleware.wire import convert, hg
from golem.middleware.wire.struct_layout import StructLayout, WireError
from golem.types import LowCommand, LowState

MACHINE = 6


def rng() -> np.random.Generator:
    return np.random.default_rng(1)


def edited(payload: bytes, layout: StructLayout, edit: Callable[[Any], None]) -> bytes:
    """Return `payload` with fields changed and, where it has one, the checksum right again."""
    changed = bytearray(payload)
    edit(layout.read(changed))
    checksum = {hg.LOW_STATE: hg.STATE_CHECKSUM, hg.LOW_CMD: hg.COMMAND_CHECKSUM}.get(layout)
    if checksum:
        checksum.seal(changed)
    return bytes(changed)


def same(a: LowState | LowCommand, b: LowState | LowCommand, names: str) -> None:
    for name in names.split():
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), name)


def test_a_state_survives_the_wire() -> None:
    state = samples.state(rng())
    payload = convert.encode_low_state(state, MACHINE)
    again = convert.decode_low_state(payload)
    assert len(payload) == 2092
    assert again.t == state.t
    same(again, state, "q dq tau")
    for name in ("quat", "gyro", "acc"):
        np.testing.assert_array_equal(getattr(again.imu, name), getattr(state.imu, name))
    assert convert.mode_machine(payload) == MACHINE


def test_a_command_survives_the_wire() -> None:
    command = samples.command(rng())
    payload = convert.encode_low_command(command, MACHINE)
    again = convert.decode_low_command(payload, 7.5, MACHINE)
    assert len(payload) == 1004
    assert again.t == 7.5
    same(again, command, "q dq tau kp kd")


def test_used_motors_are_on_and_the_others_off() -> None:
    for layout, payload in (
        (hg.LOW_STATE, convert.encode_low_state(samples.state(rng()))),
        (hg.LOW_CMD, convert.encode_low_command(samples.command(rng()), 0)),
    ):
        image = layout.read(payload)
        assert [image["first_mode"], *image["motor"]["mode"][1:]] == [1] * 27 + [0] * 8
        assert not image["motor"]["q"][27:].any()


def test_the_robots_own_estimate_is_read_by_name() -> None:
    payload = go.SPORT_MODE_STATE.blank()
    image = go.SPORT_MODE_STATE.read(payload)
    image["position"], image["velocity"], image["sec"] = (1, 2, 3), (4, 5, 6), -7
    again = go.SPORT_MODE_STATE.read(bytes(payload))
    assert (list(again["position"]), list(again["velocity"]), again["sec"]) == ([1, 2, 3], [4, 5, 6], -7)
    with pytest.raises(WireError, match="516 bytes"):
        go.SPORT_MODE_STATE.read(bytes(payload[:-4]))


def test_a_padded_payload_is_accepted() -> None:
    payload = random_images.payload(hg.IMU_STATE, rng())
    assert len(payload) == 58
    padded = b"\0\1\0\2" + payload[4:] + b"\7\7"  # the options say two bytes of padding
    assert hg.IMU_STATE.read(padded) == hg.IMU_STATE.read(payload)


def test_time_is_the_tick_and_starts_again() -> None:
    state = samples.state(rng())
    for t, tick in ((0.002, 2), (12.3456, 12346), (2**32 / 1000.0, 0)):
        payload = convert.encode_low_state(replace(state, t=t))
        assert hg.LOW_STATE.read(payload)["tick"] == tick


def test_roll_pitch_and_yaw_are_those_of_scipy() -> None:
    for rotation in Rotation.random(50, rng=rng()):
        yaw, pitch, roll = rotation.as_euler("ZYX")
        np.testing.assert_allclose(convert.rpy(rotation.as_quat(scalar_first=True)), (roll, pitch, yaw), atol=1e-9)
    image = hg.LOW_STATE.read(convert.encode_low_state(samples.state(rng())))["imu"]
    np.testing.assert_allclose(image["rpy"], convert.rpy(image["quaternion"]), atol=1e-5)


def test_a_motor_that_is_off_gets_nothing() -> None:
    payload = convert.encode_low_command(samples.command(rng()), 0)

    def off(image: Any) -> None:
        image["first_mode"] = 0
        image["motor"]["mode"][5] = 0
        image["motor"]["kp"][5] = np.nan

    command = convert.decode_low_command(edited(payload, hg.LOW_CMD, off), 0.0)
    for name in ("q", "dq", "tau", "kp", "kd"):
        values = getattr(command, name)
        assert values[0] == values[5] == 0.0
        assert np.isfinite(values).all()
    assert command.kp[1] == hg.LOW_CMD.read(payload)["motor"]["kp"][1]


DECODERS: dict[str, tuple[StructLayout, Callable[[], bytes], Callable[[bytes], object]]] = {
    "state": (hg.LOW_STATE, lambda: convert.encode_low_state(samples.state(rng())), convert.decode_low_state),
    "command": (
        hg.LOW_CMD,
        lambda: convert.encode_low_command(samples.command(rng()), 0),
        lambda payload: convert.decode_low_command(payload, 0.0),
    ),
}


@pytest.mark.parametrize("name", DECODERS)
def test_a_payload_of_another_length_or_encoding_is_refused(name: str) -> None:
    _, encode, decode = DECODERS[name]
    payload = encode()
    decode(payload)
    for wrong in (b"", payload[:3], payload[:-4], payload + bytes(4), b"\0\0" + payload[2:]):
        with pytest.raises(WireError):
            decode(wrong)


def motor(field: str, value: float) -> Callable[[Any], None]:
    def edit(image: Any) -> None:
        image["motor"][field][26] = value

    return edit


def whole(field: str, value: Any) -> Callable[[Any], None]:
    def edit(image: Any) -> None:
        image[field] = value

    return edit


def inertial(field: str, value: Any) -> Callable[[Any], None]:
    def edit(image: Any) -> None:
        image["imu"][field] = value

    return edit


@pytest.mark.parametrize(
    ("name", "edit", "words"),
    [
        ("state", motor("q", np.nan), "q of motor 26"),
        ("state", motor("tau_est", -np.inf), "tau_est of motor 26"),
        ("state", inertial("quaternion", 0.0), "no unit quaternion"),
        ("state", inertial("quaternion", np.nan), "no unit quaternion"),
        ("state", inertial("gyroscope", np.nan), "not finite"),
        ("state", inertial("accelerometer", np.inf), "not finite"),
        ("state", whole("mode_pr", 1), "mode_pr 1"),
        ("command", motor("kp", np.inf), "kp of motor 26"),
        ("command", whole("mode_pr", 1), "mode_pr 1"),
        ("command", whole("mode_machine", 5), "copy it from the LowState"),
    ],
)
def test_what_makes_no_sense_is_refused(name: str, edit: Callable[[Any], None], words: str) -> None:
    layout, encode, decode = DECODERS[name]
    with pytest.raises(WireError, match=words):
        decode(edited(encode(), layout, edit))


def test_what_would_be_refused_is_not_sent() -> None:
    state, command = samples.state(rng()), samples.command(rng())
    huge = np.full(27, 1e300)
    imu = state.imu
    for changes in (
        {"q": huge},
        {"t": -1.0},
        {"t": float("nan")},
        {"imu": replace(imu, quat=np.zeros(4))},
        {"imu": replace(imu, acc=huge[:3])},
    ):
        with pytest.raises(WireError):
            convert.encode_low_state(replace(state, **changes))
    for name in ("q", "dq", "tau", "kp", "kd"):
        with pytest.raises(WireError, match=f"{name} of motor 0"):
            convert.encode_low_command(replace(command, **{name: huge}), 0)


@pytest.mark.parametrize("name", ["state", "command"])
def test_one_wrong_bit_is_noticed(name: str) -> None:
    layout, encode, decode = DECODERS[name]
    payload = encode()
    for offset in (4, 12, 80, len(payload) // 2, len(payload) - 8, len(payload) - 1):
        damaged = bytearray(payload)
        damaged[offset] ^= 0x10
        with pytest.raises(WireError, match="checksum"):
            decode(bytes(damaged))
    assert layout.size == len(payload)


def test_a_command_says_which_state_it_answers() -> None:
    command = samples.command(rng())
    assert convert.answered(convert.encode_low_command(command, 0)) == 0.0
    payload = convert.encode_low_command(command, 0, answers=2**32 / 1000.0 + 0.007)  # the tick starts again
    assert convert.answered(payload) == 0.007
    convert.decode_low_command(payload, 0.0)
