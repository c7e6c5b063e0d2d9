"""Random values of the types that go over the wire."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from golem.types import NUM_JOINTS, Array, Imu, LowCommand, LowState

QUARTER = 0.25
"""Values are multiples of a power of two, which single precision holds exactly."""


def exact(rng: np.random.Generator, size: int, maximum: int = 40) -> Array:
    return rng.integers(-maximum, maximum, size).astype(np.float64) * QUARTER


def joints(rng: np.random.Generator) -> Array:
    return exact(rng, NUM_JOINTS, 400)


def imu(rng: np.random.Generator) -> Imu:
    quat = Rotation.random(rng=rng).as_quat(scalar_first=True).astype(np.float32).astype(float)
    return Imu(quat, exact(rng, 3), exact(rng, 3))


def state(rng: np.random.Generator) -> LowState:
    t = int(rng.integers(0, 2**31)) / 1000.0
    return LowState(t, joints(rng), joints(rng), joints(rng), imu(rng))


def command(rng: np.random.Generator) -> LowCommand:
    return LowCommand(1.5, joints(rng), joints(rng), joints(rng), abs(joints(rng)), abs(joints(rng)))
