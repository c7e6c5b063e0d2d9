"""Where the simulated robot really is and what it really touches: for evaluation and viewers, never for a module."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np

from golem.robots.model.table import BASE_LINK, SOLE
from golem.types import SIDES, Array, BaseEstimate, PlanarPose

_CORNERS = np.array([[x, y, SOLE.z] for x, y in product(SOLE.x, SOLE.y)])
"""(4, 3) corners of a sole in its ankle_roll frame [m]."""
TOUCH = 1.0
"""Force from which a foot counts as in contact [N]."""


@dataclass(frozen=True, slots=True)
class BaseTruth:
    """Pose (4, 4), velocity (3,) in the world [m/s] and rate (3,) in base_link [rad/s] of base_link."""

    T_world_base: Array
    velocity: Array
    rate: Array

    @property
    def tilt(self) -> float:
        """Angle between the base's and the world's up [rad]."""
        return math.acos(min(max(float(self.T_world_base[2, 2]), -1.0), 1.0))


class Truth:
    """Reads a simulation; every call describes the present state.

    Contacts, forces and centre of mass are those at the start of the last physics step.

    Attributes:
        T_world_odom: (4, 4) pose of the odom frame in the world: the base at the start, which is upright.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Read `data` of `model`, whose robot moves on the free joint `base` and is where an episode starts."""
        self._model, self._data = model, data
        self._base = model.body(BASE_LINK).id
        joint = model.joint("base")
        self._q, self._v = int(joint.qposadr[0]), int(joint.dofadr[0])
        self._feet = [model.body(f"{side}_ankle_roll_link").id for side in SIDES]
        mine = model.body_rootid == self._base
        # Per geom: -1 for the world, 0 and 1 for the feet, 2 for the rest of the robot.
        part = np.where(mine[model.geom_bodyid], len(SIDES), -1)
        for foot, body in enumerate(self._feet):
            part[model.geom_bodyid == body] = foot
        self._part: list[int] = part.tolist()
        self.T_world_odom: Array = self.base().T_world_base

    def base(self) -> BaseTruth:
        """Return where base_link is and how it moves."""
        T, R, q = np.zeros((4, 4)), np.empty(9), self._data.qpos[self._q : self._q + 7]
        mujoco.mju_quat2Mat(R, q[3:])
        T[:3, :3], T[:3, 3], T[3, 3] = R.reshape(3, 3), q[:3], 1.0
        v = self._data.qvel[self._v : self._v + 6]
        return BaseTruth(T, v[:3].copy(), v[3:].copy())

    def estimate(self, t: float) -> BaseEstimate:
        """Return the same at `t` [s], in the words of an estimate."""
        truth, odom = self.base(), self.T_world_odom
        R, T = odom[:3, :3], truth.T_world_base
        height = float(T[2, 3] - self.soles()[:, :, 2].min())
        contact = (self.foot_forces()[:, 2] > TOUCH).astype(np.float64)
        return BaseEstimate(t, np.linalg.inv(odom) @ T, truth.velocity @ R, height, contact)

    def pose(self) -> PlanarPose:
        """Return where the robot stands and heads in odom."""
        return PlanarPose.of(np.linalg.inv(self.T_world_odom) @ self.base().T_world_base)

    @property
    def com_position(self) -> Array:
        """The (3,) position of `com` alone, at a tenth of the price."""
        return self._data.subtree_com[self._base].copy()

    def com(self) -> tuple[Array, Array]:
        """Return position [m] and velocity [m/s] of the robot's centre of mass in the world, (3,) each."""
        mujoco.mj_subtreeVel(self._model, self._data)
        return self.com_position, self._data.subtree_linvel[self._base].copy()

    def soles(self) -> Array:
        """Return the corners of the left and the right sole in the world, (2, 4, 3) [m]."""
        R = self._data.xmat[self._feet].reshape(2, 3, 3)
        return self._data.xpos[self._feet][:, None] + np.einsum("fij,cj->fci", R, _CORNERS)

    def foot_forces(self) -> Array:
        """Return the force of the world on the left and the right foot, (2, 3) [N], in the world."""
        forces, wrench, part = ([0.0] * 3, [0.0] * 3), np.zeros(6), self._part
        contact = self._data.contact
        frames = contact.frame.tolist()
        for i, (one, other) in enumerate(contact.geom.tolist()):
            parts = part[one], part[other]
            foot = max(parts)
            if min(parts) >= 0 or foot not in (0, 1):
                continue
            mujoco.mj_contactForce(self._model, self._data, i, wrench)
            # The contact's normal points from its first geom to its second, and so does the force on the second.
            sign = 1.0 if foot == parts[1] else -1.0
            normal, tangent, other_tangent = wrench.tolist()[:3]
            for a, (n, u, v) in enumerate(zip(frames[i][:3], frames[i][3:6], frames[i][6:], strict=True)):
                forces[foot][a] += sign * (normal * n + tangent * u + other_tangent * v)
        return np.array(forces)

    def touches(self) -> tuple[str, ...]:
        """Return the bodies other than the feet that touch something that is not the robot, sorted."""
        names = set[str]()
        for pair in self._data.contact.geom.tolist():
            parts = [self._part[geom] for geom in pair]
            if min(parts) < 0 and max(parts) == len(SIDES):
                geom = pair[parts.index(len(SIDES))]
                names.add(self._model.body(self._model.geom_bodyid[geom]).name)
        return tuple(sorted(names))

    def fallen(self, height: float = 0.6, tilt: float = 1.0, base: BaseTruth | None = None) -> bool:
        """Return whether base_link is less than `height` [m] above the lower sole or leans more than `tilt` [rad].

        `base` is what `base` says now, if that is known.
        """
        base = base or self.base()
        floor = min(float(self._data.xpos[foot, 2]) for foot in self._feet) + SOLE.z
        return bool(base.T_world_base[2, 3] - floor < height) or base.tilt > tilt
