"""Forces from outside on the robot's bodies: the hoist's, and what a judge's rod or a viewer's button does.

The hoist holds the pelvis: the legs unloaded, or the feet on the floor until it is let go.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from golem.errors import ConfigError, unknown_name
from golem.kernels import njit
from golem.native import Record, Records, address, floats, new_record
from golem.robots.model.table import LINKS
from golem.types import Array

_MOST = len(LINKS)

PUSHES = np.dtype(
    [
        ("count", "i8"),
        ("body", "i8", (_MOST,)),
        ("force", "f8", (_MOST, 3)),
        ("off_centre", "i8", (_MOST,)),
        ("point", "f8", (_MOST, 3)),
    ]
)
"""The forces that act: (3,) in the world [N]; where one is `off_centre`, at a point in the frame of its link [m]."""


@njit(cache=True, nogil=True)
def clear_pushes(m: Record, xfrc: int) -> None:
    """Take the forces of the previous physics step off; arrays of the simulation by address."""
    out = floats(xfrc)
    for k in range(m.count):
        for i in range(6):
            out[6 * m.body[k] + i] = 0.0


@njit(cache=True, nogil=True)
def apply_pushes(m: Record, xfrc: int, xpos: int, xmat: int, xipos: int) -> None:
    """Add the forces for the present state to whatever else acts on the bodies; arrays by address."""
    out, p, R, com, lever = floats(xfrc), floats(xpos), floats(xmat), floats(xipos), np.empty(3)
    for k in range(m.count):
        at, body, force = 6 * m.body[k], m.body[k], m.force[k]
        for i in range(3):
            out[at + i] += force[i]
        if m.off_centre[k]:
            # MuJoCo applies it at the centre of mass.
            for i in range(3):
                lever[i] = p[3 * body + i] - com[3 * body + i]
                for j in range(3):
                    lever[i] += R[9 * body + 3 * i + j] * m.point[k, j]
            out[at + 3] += lever[1] * force[2] - lever[2] * force[1]
            out[at + 4] += lever[2] * force[0] - lever[0] * force[2]
            out[at + 5] += lever[0] * force[1] - lever[1] * force[0]


class Pushes:
    """External forces, each constant in the world until it is changed; `memory` is a `PUSHES`."""

    def __init__(self, model: mujoco.MjModel, memory: Records | None = None) -> None:
        """Push bodies of `model`; there is no force yet. `memory`, a `PUSHES`, None for one of its own."""
        self._model = model
        self.memory = new_record(PUSHES) if memory is None else memory
        self._rows: dict[str, int] = {}

    def set(self, force: Array, body: str, point: Array | None) -> None:
        """Replace the force on `body`; arguments as in `MujocoRobot.push`.

        Raises ConfigError: the robot has no such link, or an array has another shape or is not finite.
        """
        if body not in LINKS:
            raise unknown_name("link to push", body, LINKS)
        force, point = np.array(force, float), None if point is None else np.array(point, float)
        for array in (force, point):
            if array is not None and (array.shape != (3,) or not all(map(math.isfinite, array.tolist()))):
                raise ConfigError("A push is a force of three finite numbers [N] at a point of three [m].")
        row, k = self.memory[0], self._rows.get(body)
        if k is None:
            k = self._rows[body] = len(self._rows)
            row["count"], row["body"][k] = k + 1, self._model.body(body).id
        row["force"][k], row["off_centre"][k] = force, point is not None
        if point is not None:
            row["point"][k] = point

    @property
    def acting(self) -> tuple[str, Array] | None:
        """The link with the largest force on it, and that force (3,) in the world [N]; None where there is none."""
        row = self.memory[0]
        forces = row["force"][: row["count"]]
        if not forces.any():
            return None
        k = int((forces * forces).sum(axis=1).argmax())
        return self._model.body(int(row["body"][k])).name, forces[k].copy()

    def clear(self, data: mujoco.MjData) -> None:
        """Take the forces of the previous physics step off."""
        clear_pushes(self.memory[0], address(data.xfrc_applied))

    def apply(self, data: mujoco.MjData) -> None:
        """Add the forces for the present state to whatever else acts on the bodies."""
        places = address(data.xpos), address(data.xmat), address(data.xipos)
        apply_pushes(self.memory[0], address(data.xfrc_applied), *places)


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
        *((name, "i8") for name in ("body", "q", "v")),
        *((name, "f8", (3,)) for name in ("weight", "home")),
        *((name, "f8", (2, 3)) for name in ("k", "d")),
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
    """Spring and damper from pelvis to hook, preloaded with the robot's weight; `memory` is a `HOIST`."""

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
