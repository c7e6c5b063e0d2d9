"""Inputs of the suites: a robot that stands, sways and moves its arms a little, and what its cameras see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.legs.hold import STANCES
from golem.robots.model.table import load_limits
from golem.robots.sensors.cameras import HEAD, rays
from golem.types import (
    LEGS,
    NUM_JOINTS,
    TICK,
    UPPER,
    Array,
    BaseEstimate,
    CameraInfo,
    Detection,
    HandState,
    Imu,
    LocalizedObject,
    LowState,
    RgbdImage,
)

HEIGHT = 0.96
"""Height of base_link above the soles of a robot that stands in a crouch [m]."""
NAN = float("nan")


def posture() -> Array:
    """Return the (27,) joints of a robot that stands, arms at home [rad]."""
    q = np.zeros(NUM_JOINTS)
    q[LEGS] = np.tile(STANCES["crouch"], 2)
    q[UPPER] = POSTURES["home"]
    return q


def state(t: float, q: Array | None = None, **changes: Array) -> LowState:
    """Return what a standing robot reports at `t` [s], with other `q`, `dq`, `tau`, `quat`, `gyro` or `acc`."""
    phase = 2.0 * np.pi * (0.7 * t + np.arange(NUM_JOINTS) / NUM_JOINTS)
    arrays = {"dq": 0.02 * np.cos(phase), "tau": np.sin(phase)} | changes
    quat, gyro = tilt(0.01 * np.sin(4.0 * t)), np.array([0.0, 0.04 * np.cos(4.0 * t), 0.0])
    own = (("quat", quat), ("gyro", gyro), ("acc", np.array([0.1, 0.0, 9.81])))
    imu = Imu(*(arrays.pop(name, value) for name, value in own))
    return LowState(t, posture() + 0.005 * np.sin(phase) if q is None else q, arrays["dq"], arrays["tau"], imu)


def tilt(pitch: float) -> Array:
    """Return the (4,) quaternion, wxyz, of a robot pitched by `pitch` [rad]."""
    return np.array([np.cos(0.5 * pitch), 0.0, np.sin(0.5 * pitch), 0.0])


def states(count: int, period: float = TICK) -> list[LowState]:
    """Return `count` states in a row."""
    return [state((i + 1) * period) for i in range(count)]


def base(t: float, **changes: object) -> BaseEstimate:
    """Return where the base of that robot is, with other fields of `BaseEstimate`."""
    T = np.eye(4)
    T[:3, 3] = 0.002 * np.sin(4.0 * t), 0.0, HEIGHT
    estimate = BaseEstimate(t, T, np.array([0.008 * np.cos(4.0 * t), 0.0, 0.0]), HEIGHT, np.ones(2))
    return replace(estimate, **changes)  # pyright: ignore[reportArgumentType]


def with_nan(values: Array, index: int = 3) -> Array:
    """Return a copy of `values` in which one is NaN."""
    out = np.array(values, dtype=np.float64)
    out.flat[index % out.size] = NAN
    return out


def spoiled_states(t: float) -> dict[str, LowState]:
    """Return states with a NaN each, by where it is."""
    sound = state(t)
    return {
        "q": state(t, q=with_nan(sound.q)),
        "dq": state(t, dq=with_nan(sound.dq)),
        "the IMU's quaternion": state(t, quat=with_nan(sound.imu.quat)),
        "the IMU's gyro": state(t, gyro=with_nan(sound.imu.gyro, 1)),
    }


def edge_states() -> dict[str, Callable[[float], LowState]]:
    """Return, by what it is, how a robot at an edge of its range looks at a time [s]."""
    limits = load_limits()
    return {
        "joints at their lower limits": lambda t: state(t, q=limits.lower.copy()),
        "joints at their upper limits": lambda t: state(t, q=limits.upper.copy()),
        "a robot pitched by 0.5 rad": lambda t: state(t, quat=tilt(0.5)),
        "joints at half their speed": lambda t: state(t, dq=0.5 * limits.velocity),
    }


def hand_state(t: float, gap: float, force: float = 0.0) -> HandState:
    """Return the report of a hand that is open by `gap` [m] and presses with `force` [N]."""
    return HandState(t, gap, np.full(2, 0.5 * gap), np.full(2, force))


@lru_cache(maxsize=4)
def _picture(info: CameraInfo) -> tuple[Array, Array]:
    """Return colour and depth of a grey plate with dark round spots, half a metre below the camera."""
    v, u = np.mgrid[: info.height, : info.width]
    spot = np.hypot((u % 80) - 40.0, (v % 80) - 40.0) < 9.0
    grey = 150.0 + 20.0 * np.sin(0.05 * u) - 90.0 * spot
    rgb = np.repeat(np.clip(grey, 0, 255)[..., None], 3, axis=2)
    return rgb, np.where(spot, 0.49, 0.50) * rays(info)[..., 2].astype(np.float64)


def image(t: float, info: CameraInfo = HEAD) -> RgbdImage:
    """Return a frame of a camera that looks straight down on that plate at time `t` [s]."""
    rgb, depth = _picture(info)
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[:3, 3] = 0.4, 0.0, 0.3
    return RgbdImage(t, info, rgb.astype(np.uint8), depth.astype(np.float32), T)


def seen_object(t: float, position: Array, points: int = 200) -> LocalizedObject:
    """Return a screw seen at `position` (3,) in odom [m], with so many points of its surroundings."""
    spread = np.random.default_rng(7).uniform(-0.02, 0.02, (points, 3)) * (1.0, 1.0, 0.0)
    cloud = position + spread - np.where(np.hypot(*spread[:, :2].T) < 0.007, 0.0, 0.015)[:, None] * (0, 0, 1)
    box = np.array([310.0, 230.0, 330.0, 250.0])
    return LocalizedObject(Detection("screw", 0.9, box, np.array([320.0, 240.0])), t, position.copy(), cloud)
