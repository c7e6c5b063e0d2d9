"""The hoist that holds the robot at the pelvis, its legs unloaded."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

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


class Hoist:
    """Spring and damper between the pelvis and the hook, preloaded with the robot's weight."""

    def __init__(self, model: mujoco.MjModel, config: HoistConfig) -> None:
        """Hang the body `pelvis` of `model`."""
        self._body = model.body("pelvis").id
        self._dof = int(model.body_dofadr[self._body])
        mass = float(model.body_subtreemass[self._body])
        self._weight = -mass * model.opt.gravity
        self._home = np.array([0.0, 0.0, config.height])
        self._k = np.array(config.stiffness)
        self._d = 2.0 * config.damping_ratio * np.sqrt(self._k * mass)
        self._k_rot = np.array(config.rotational_stiffness)
        # 8 kg m^2: the robot about its pelvis, order of magnitude; only the damping ratio depends on it.
        self._d_rot = 2.0 * config.damping_ratio * np.sqrt(self._k_rot * 8.0)

    def apply(self, data: mujoco.MjData, sway: Array) -> None:
        """Set the wrench on the pelvis for the present state; the hook is displaced by `sway` (2,) [m]."""
        wrench = data.xfrc_applied[self._body]
        position = data.qpos[self._dof : self._dof + 3]
        w, x, y, z = data.qpos[self._dof + 3 : self._dof + 7]
        velocity = data.qvel[self._dof : self._dof + 6]
        home = self._home.copy()
        home[:2] += sway
        wrench[:3] = self._k * (home - position) - self._d * velocity[:3] + self._weight
        # Small rotations: the vector part of the quaternion is half the rotation vector. A free joint's angular
        # velocity is in the body frame, which differs from the world's by that same small rotation.
        sign = 2.0 if w >= 0.0 else -2.0
        wrench[3:] = -self._k_rot * (sign * np.array([x, y, z])) - self._d_rot * velocity[3:]
