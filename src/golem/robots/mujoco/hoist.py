"""The hoist that holds the robot at the pelvis: its legs unloaded, or its feet on the floor until it is let go."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco

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


class Hoist:
    """Spring and damper between the pelvis and the hook, preloaded with the robot's weight."""

    def __init__(self, model: mujoco.MjModel, config: HoistConfig) -> None:
        """Hang the body `pelvis` of `model` from its free joint `base`."""
        self._body = model.body("pelvis").id
        joint = model.joint("base")
        self._position = slice(int(joint.qposadr[0]), int(joint.qposadr[0]) + 3)
        self._attitude = slice(self._position.stop, self._position.stop + 4)
        self._velocity = slice(int(joint.dofadr[0]), int(joint.dofadr[0]) + 6)
        mass = float(model.body_subtreemass[self._body])
        self._weight: list[float] = (-mass * model.opt.gravity).tolist()
        self._home = (0.0, 0.0, config.height)
        self._k, self._k_rot = config.stiffness, config.rotational_stiffness
        self._d = [2.0 * config.damping_ratio * math.sqrt(k * mass) for k in self._k]
        # 8 kg m^2: the robot about its pelvis, order of magnitude; only the damping ratio depends on it.
        self._d_rot = [2.0 * config.damping_ratio * math.sqrt(k * 8.0) for k in self._k_rot]
        self._released_at = math.inf

    @property
    def released(self) -> bool:
        """Whether `release` was called."""
        return self._released_at < math.inf

    def release(self, t: float) -> None:
        """Let go smoothly from time `t` [s] on; a second call does nothing."""
        self._released_at = min(self._released_at, t)

    def apply(self, data: mujoco.MjData, sway: Array) -> None:
        """Set the wrench on the pelvis for the present state; the hook is displaced by `sway` (2,) [m]."""
        share = self._share(data.time)
        if share == 0.0:
            data.xfrc_applied[self._body] = 0.0
            return
        # Scalars: this runs at every physics step, where small arrays cost more than the arithmetic.
        x, y, z = data.qpos[self._position].tolist()
        w, *axis = data.qpos[self._attitude].tolist()
        vx, vy, vz, *rate = data.qvel[self._velocity].tolist()
        hook_x, hook_y, hook_z = self._home
        hook_x, hook_y = hook_x + float(sway[0]), hook_y + float(sway[1])
        k, d, carry = self._k, self._d, self._weight
        # Small rotations: the vector part of the quaternion is half the rotation vector. A free joint's angular
        # velocity is in the body frame, which differs from the world's by that same small rotation.
        sign = 2.0 if w >= 0.0 else -2.0
        k_rot, d_rot = self._k_rot, self._d_rot
        data.xfrc_applied[self._body] = (
            k[0] * (hook_x - x) - d[0] * vx + carry[0],
            k[1] * (hook_y - y) - d[1] * vy + carry[1],
            k[2] * (hook_z - z) - d[2] * vz + carry[2],
            -k_rot[0] * sign * axis[0] - d_rot[0] * rate[0],
            -k_rot[1] * sign * axis[1] - d_rot[1] * rate[1],
            -k_rot[2] * sign * axis[2] - d_rot[2] * rate[2],
        )
        if share < 1.0:
            data.xfrc_applied[self._body] *= share

    def _share(self, t: float) -> float:
        """Return how much of the wrench is left at time `t` [s], 1 to 0."""
        gone = (t - self._released_at) / RELEASE_TIME
        return 1.0 if gone <= 0.0 else 0.0 if gone >= 1.0 else 0.5 * (1.0 + math.cos(math.pi * gone))
