"""The hoist that holds the robot at the pelvis: its legs unloaded, or its feet on the floor until it is let go."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from golem.kernels import njit
from golem.native import Record, Records, address, floats, new_record
from golem.types import Array


@dataclass(frozen=True)
class HoistConfig:
    """Stiffness of the suspension; nobody published the authors', so all of it is assumed.

    Straps around the shoulders and a spreader bar: stiff upwards, soft sideways, and stiff enough about all axes
    that the torso does not swing when an arm reaches out.

    Attributes:
        height: height of the pelvis above the floor [m]; the feet hang clear of it.
        stiffness: x, y, z [N/m].
        rotational_stiffness: roll, pitch, yaw [N m/rad].
        damping_ratio: of critical damping, on every axis.
    """

    height: float = 1.10
    stiffness: tuple[float, float, float] = (4000.0, 4000.0, 40000.0)
    rotational_stiffness: tuple[float, float, float] = (4000.0, 4000.0, 2000.0)
    damping_ratio: float = 0.7


RELEASE_TIME = 0.5
"""Time in which a released hoist hands the weight over to the feet [s]."""


HOIST = np.dtype(
    [
        ("body", "i8"),
        ("q", "i8"),
        ("v", "i8"),
        ("weight", "f8", (3,)),
        ("home", "f8", (3,)),
        ("k", "f8", (2, 3)),
        ("d", "f8", (2, 3)),
        ("released_at", "f8"),
    ]
)
"""Indices, options and memory of a hoist: stiffness and damping along the axes, then about them."""


@njit(cache=True, nogil=True)
def pull(h: Record, time: float, sway_x: float, sway_y: float, qpos: int, qvel: int, xfrc: int) -> None:
    """Set the wrench on the pelvis; see `Hoist.apply`. Arrays of the simulation by address."""
    out, at = floats(xfrc), 6 * h.body
    gone = (time - h.released_at) / RELEASE_TIME
    if gone >= 1.0:
        for i in range(6):
            out[at + i] = 0.0
        return
    share = 1.0 if gone <= 0.0 else 0.5 * (1.0 + math.cos(math.pi * gone))
    q, v = floats(qpos), floats(qvel)
    # Small rotations: the vector part of the quaternion is half the rotation vector. A free joint's angular
    # velocity is in the body frame, which differs from the world's by that same small rotation.
    sign = 2.0 if q[h.q + 3] >= 0.0 else -2.0
    for i in range(3):
        hook = h.home[i] + (sway_x if i == 0 else sway_y if i == 1 else 0.0)
        out[at + i] = share * (h.k[0, i] * (hook - q[h.q + i]) - h.d[0, i] * v[h.v + i] + h.weight[i])
        turn = -h.k[1, i] * sign * q[h.q + 4 + i] - h.d[1, i] * v[h.v + 3 + i]
        out[at + 3 + i] = share * turn


class Hoist:
    """Spring and damper between the pelvis and the hook, preloaded with the robot's weight.

    Attributes:
        memory: a `HOIST`.
    """

    def __init__(self, model: mujoco.MjModel, config: HoistConfig, memory: Records | None = None) -> None:
        """Hang `pelvis` of `model` from its free joint `base`; `memory`, a `HOIST`, None for one of its own."""
        joint, pelvis = model.joint("base"), model.body("pelvis").id
        mass = float(model.body_subtreemass[pelvis])
        self.memory = memory = new_record(HOIST) if memory is None else memory
        memory["body"], memory["q"], memory["v"] = pelvis, joint.qposadr[0], joint.dofadr[0]
        memory["weight"] = -mass * model.opt.gravity
        memory["home"] = 0.0, 0.0, config.height
        memory["k"] = config.stiffness, config.rotational_stiffness
        memory["d"] = (
            [2.0 * config.damping_ratio * math.sqrt(k * mass) for k in config.stiffness],
            # 8 kg m^2: the robot about its pelvis, order of magnitude; only the damping ratio depends on it.
            [2.0 * config.damping_ratio * math.sqrt(k * 8.0) for k in config.rotational_stiffness],
        )
        memory["released_at"] = math.inf

    @property
    def released(self) -> bool:
        """Whether `release` was called."""
        return bool(self.memory["released_at"][0] < math.inf)

    def release(self, t: float) -> None:
        """Let go smoothly from time `t` [s] on; a second call does nothing."""
        self.memory["released_at"] = np.minimum(self.memory["released_at"], t)

    def apply(self, data: mujoco.MjData, sway: Array) -> None:
        """Set the wrench on the pelvis for the present state; the hook is displaced by `sway` (2,) [m]."""
        qpos, qvel, xfrc = address(data.qpos), address(data.qvel), address(data.xfrc_applied)
        pull(self.memory[0], data.time, float(sway[0]), float(sway[1]), qpos, qvel, xfrc)
