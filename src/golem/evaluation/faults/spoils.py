"""What faults are made of: how frames, measurements, motors and the gate are spoilt."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from golem.evaluation.faults.rig import Edit, FaultMoment, Injection
from golem.middleware.wire.convert import encode_low_command
from golem.types import NUM_JOINTS, Array, Imu, LowCommand, LowState

Senses = Callable[[FaultMoment, LowState], LowState]
Motors = Callable[[FaultMoment, LowCommand], LowCommand]
AtGate = Callable[[FaultMoment, Any], None]


def set_to(value: Any, *path: Any) -> Edit:
    """Return an edit that writes a value, or what it returns at a moment, at `path` in the image of a frame."""

    def edit(m: FaultMoment, image: Any) -> None:
        for key in path[:-1]:
            image = image[key]
        image[path[-1]] = value(m) if callable(value) else value

    return edit


def frame_faults(
    where: str, byte: int, stop: Callable[..., Injection], bear: Callable[..., Injection]
) -> Iterator[Injection]:
    """Yield frames, of `state` or `command`, with a wrong checksum at `byte`, or cut, random, lost or twice."""

    def flipped(payload: bytes) -> bytes:
        wrong = bytearray(payload)
        wrong[byte] ^= 1
        return bytes(wrong)

    def spoilt(spoil: Callable[[FaultMoment, bytes], list[bytes]]) -> dict[str, Any]:
        return {where: spoil}

    yield bear("checksum wrong once", **spoilt(lambda m, p: [flipped(p) if m.k == 0 else p]))
    yield bear("checksum wrong in 1 of 100", **spoilt(lambda m, p: [p if m.k % 100 else flipped(p)]))
    yield stop("checksum wrong in 1 of 5", within=0.05, **spoilt(lambda m, p: [p if m.k % 5 else flipped(p)]))
    yield stop("checksum always wrong", **spoilt(lambda m, p: [flipped(p)]))
    yield bear("truncated once", **spoilt(lambda m, p: [p[:-8] if m.k == 0 else p]))
    yield stop("truncated", **spoilt(lambda m, p: [p[:-8]]))
    yield stop("random bytes", **spoilt(lambda m, p: [p[:4] + m.rng.bytes(len(p) - 4)]))
    yield bear("half lost", **spoilt(lambda m, p: [p] if m.k % 2 else []))
    yield bear("every frame twice", **spoilt(lambda m, p: [p, p]))


def shifted(where: Any, by: Callable[[FaultMoment], float], field: str = "q") -> Senses:
    """Return what adds `by` to one of the measured fields of joints."""

    def spoil(m: FaultMoment, state: LowState) -> LowState:
        array = getattr(state, field).copy()
        array[where] += by(m)
        return replace(state, **{field: array})

    return spoil


def reordered(order: list[int]) -> Senses:
    """Return what takes joints for others: joint i reports what joint `order[i]` measures."""
    return lambda m, state: replace(state, q=state.q[order], dq=state.dq[order], tau=state.tau[order])


def by_imu(change: Callable[[FaultMoment, Imu], Imu]) -> Senses:
    """Return what a fault makes of the IMU as the robot measures."""
    return lambda m, state: replace(state, imu=change(m, state.imu))


def turned(axis: int, angle: float, quat: Array) -> Array:
    """Return `quat` (4,) wxyz, turned by `angle` [rad] about a world axis."""
    w, v = np.cos(angle / 2), np.sin(angle / 2) * np.eye(3)[axis]
    return np.concatenate(([w * quat[0] - v @ quat[1:]], w * quat[1:] + quat[0] * v + np.cross(v, quat[1:])))


def weak(joint: int, share: Callable[[FaultMoment], float]) -> Motors:
    """Return motors of which one gives a share of its torque."""

    def motors(m: FaultMoment, c: LowCommand) -> LowCommand:
        gain = np.where(np.arange(NUM_JOINTS) == joint, share(m), 1.0)
        return replace(c, kp=c.kp * gain, kd=c.kd * gain, tau=c.tau * gain)

    return motors


def second_writer(topic: str, commands: bool = False) -> AtGate:
    """Return a stranger on a topic, who may write commands."""

    def write(m: FaultMoment, rig: Any) -> None:
        if "writer" not in m.kept:
            m.kept["writer"] = rig.writer(topic)
        if commands:
            zeros, ones = np.zeros(NUM_JOINTS), np.ones(NUM_JOINTS)
            command = LowCommand(rig.t, 0.3 * ones, zeros, zeros, 200.0 * ones, 2.0 * ones)
            m.kept["writer"].write(encode_low_command(command, 0, answers=rig.t))

    return write
