"""Payloads with a random value in every field, and the same messages as objects of the vendor's SDK."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from tests.middleware.wire import go

from golem.middleware.wire import hg
from golem.middleware.wire.hg import Checksum
from golem.middleware.wire.struct_layout import StructLayout


def fill(image: Any, rng: np.random.Generator) -> None:
    """Give every field a random value that Python's floats and integers say exactly."""
    for name in image.dtype.names:
        field = image[name]
        if field.dtype.names:
            fill(field, rng)
        elif name == "mode" and field.shape:
            continue
        elif field.dtype.kind == "f":
            image[name] = rng.normal(0.0, 100.0, field.shape)
        else:
            limits = np.iinfo(field.dtype)
            image[name] = rng.integers(limits.min, limits.max, field.shape, field.dtype, endpoint=True)
    if "first_mode" in image.dtype.names:
        image["motor"]["mode"][1:] = rng.integers(0, 256, hg.MOTORS - 1, np.uint8)


def payload(layout: StructLayout, rng: np.random.Generator) -> bytes:
    """Return a random message; its checksum, where it has one, is random too."""
    out = layout.blank()
    fill(layout.read(out), rng)
    return bytes(out)


def values(image: Any, *names: str) -> list[Any]:
    """Return fields as Python says them."""
    return [image[name].tolist() for name in names]


IMU = ("quaternion", "gyroscope", "accelerometer", "rpy", "temperature")
STATE = ("q", "dq", "ddq", "tau_est", "temperature", "vol", "sensor", "motorstate", "reserve")
CMD = ("q", "dq", "tau", "kp", "kd", "reserve")


def _motors(image: Any, kind: Callable[..., Any], names: tuple[str, ...]) -> list[Any]:
    modes = [int(image["first_mode"]), *image["motor"]["mode"][1:].tolist()]
    return [kind(mode, *values(motor, *names)) for mode, motor in zip(modes, image["motor"], strict=True)]


def sdk_state(sdk: SimpleNamespace, image: Any) -> Any:
    """Return the vendor's `LowState_` with the values of `image`."""
    return sdk.hg.LowState_(
        *values(image, "version", "mode_pr", "mode_machine", "tick"),
        sdk.hg.IMUState_(*values(image["imu"], *IMU)),
        _motors(image, sdk.hg.MotorState_, STATE),
        *values(image, "wireless_remote", "reserve", "crc"),
    )


def sdk_command(sdk: SimpleNamespace, image: Any) -> Any:
    """Return the vendor's `LowCmd_` with the values of `image`."""
    return sdk.hg.LowCmd_(
        *values(image, "mode_pr", "mode_machine"),
        _motors(image, sdk.hg.MotorCmd_, CMD),
        *values(image, "reserve", "crc"),
    )


def sdk_imu(sdk: SimpleNamespace, image: Any) -> Any:
    """Return the vendor's `IMUState_` with the values of `image`."""
    return sdk.hg.IMUState_(*values(image, *IMU))


def sdk_sport(sdk: SimpleNamespace, image: Any) -> Any:
    """Return the vendor's `SportModeState_` with the values of `image`."""
    names = go.SPORT_MODE_STATE.dtype.names or ()
    path = [
        sdk.go.PathPoint_(*values(point, *(image["path_point"].dtype.names or ()))) for point in image["path_point"]
    ]
    return sdk.go.SportModeState_(
        sdk.go.TimeSpec_(*values(image, "sec", "nanosec")),
        *values(image, "error_code"),
        sdk.go.IMUState_(*values(image["imu"], *IMU)),
        *values(image, *names[names.index("mode") : -1]),
        path,
    )


MESSAGES: dict[str, tuple[StructLayout, Callable[[SimpleNamespace, Any], Any], Checksum | None]] = {
    "LowState": (hg.LOW_STATE, sdk_state, hg.STATE_CHECKSUM),
    "LowCmd": (hg.LOW_CMD, sdk_command, hg.COMMAND_CHECKSUM),
    "IMUState": (hg.IMU_STATE, sdk_imu, None),
    "SportModeState": (go.SPORT_MODE_STATE, sdk_sport, None),
}
