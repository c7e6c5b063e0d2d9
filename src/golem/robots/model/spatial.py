"""Rigid transforms, quaternions and inertias: the little algebra that the model builders share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from golem.types import Array


def rotation_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Return the (3, 3) rotation Rz(yaw) Ry(pitch) Rx(roll), the convention of URDF."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_of(rotation: Array) -> tuple[float, float, float]:
    """Return roll, pitch, yaw [rad] of a (3, 3) rotation, pitch within +-pi/2 (URDF convention)."""
    pitch = float(np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0])))
    if abs(abs(pitch) - np.pi / 2) < 1e-9:  # roll and yaw turn about one axis: put it all into yaw
        return 0.0, pitch, float(np.arctan2(-rotation[0, 1], rotation[1, 1]))
    roll = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
    return roll, pitch, float(np.arctan2(rotation[1, 0], rotation[0, 0]))


def quat_of(rotation: Array) -> Array:
    """Return the (4,) unit quaternion wxyz, w >= 0, of a (3, 3) rotation."""
    # The eigenvector of the largest eigenvalue of K (Bar-Itzhack 2000) is the quaternion, at any angle.
    k, twice = np.empty((4, 4)), rotation - rotation.T
    k[0, 0] = np.trace(rotation)
    k[0, 1:] = k[1:, 0] = twice[2, 1], twice[0, 2], twice[1, 0]
    k[1:, 1:] = rotation + rotation.T - np.trace(rotation) * np.eye(3)
    q = np.linalg.eigh(k)[1][:, -1]
    return q if q[0] >= 0 else -q


def quat_to_axis(axis: Array) -> Array:
    """Return the (4,) quaternion, wxyz, of a frame whose x axis has the direction of `axis` (3,)."""
    x = axis / np.linalg.norm(axis)
    y = np.cross(x, np.eye(3)[int(np.argmin(np.abs(x)))])
    y /= np.linalg.norm(y)
    return quat_of(np.column_stack([x, y, np.cross(x, y)]).astype(np.float64))


def transform(xyz: Sequence[float] | Array, rotation: Array | None = None) -> Array:
    """Return the (4, 4) transform with translation `xyz` [m] and the (3, 3) `rotation` (default: none)."""
    out = np.eye(4)
    out[:3, 3] = xyz
    if rotation is not None:
        out[:3, :3] = rotation
    return out


def seen_from(T_a_b: Array, T_a_c: Array) -> Array:
    """Return T_b_c, the pose of c as seen from b; both poses (4, 4) are given in one frame and rigid."""
    R, out = T_a_b[:3, :3].T, np.zeros((4, 4))
    out[:3, :3], out[:3, 3], out[3, 3] = R @ T_a_c[:3, :3], R @ (T_a_c[:3, 3] - T_a_b[:3, 3]), 1.0
    return out


def skew(v: Array) -> Array:
    """Return the (..., 3, 3) matrices of the cross product with `v` (..., 3): `skew(a) @ b` is a x b."""
    return (v @ _LEVI_CIVITA).reshape(*v.shape, 3)


_LEVI_CIVITA: Array = np.zeros((3, 9))
"""Entry (j, 3 i + k) is the sign of the permutation (i, j, k)."""
_LEVI_CIVITA[[0, 0, 1, 1, 2, 2], [7, 5, 2, 6, 3, 1]] = (1.0, -1.0, 1.0, -1.0, 1.0, -1.0)


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass properties of a rigid body in some frame.

    Attributes:
        mass: [kg].
        com: (3,) centre of mass [m].
        inertia: (3, 3) inertia about the centre of mass, in the axes of the frame [kg m^2].
    """

    mass: float
    com: Array
    inertia: Array

    @classmethod
    def of(cls, mass: float, com: Sequence[float], six: Sequence[float]) -> Inertial:
        """Build one from the six numbers ixx, ixy, ixz, iyy, iyz, izz."""
        xx, xy, xz, yy, yz, zz = six
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float)
        return cls(float(mass), np.array(com, dtype=float), matrix)

    def six(self) -> tuple[float, float, float, float, float, float]:
        """Return ixx, ixy, ixz, iyy, iyz, izz [kg m^2]."""
        xx, xy, xz, yy, yz, zz = self.inertia[np.triu_indices(3)].tolist()
        return xx, xy, xz, yy, yz, zz

    def mirrored(self) -> Inertial:
        """Return the mirror image in the xz plane (left for right)."""
        m = np.diag([1.0, -1.0, 1.0])
        return Inertial(self.mass, m @ self.com, m @ self.inertia @ m)

    def moved(self, T_a_b: Array) -> Inertial:
        """Return the same body, given in frame b, in frame a."""
        R = T_a_b[:3, :3]
        return Inertial(self.mass, T_a_b[:3, :3] @ self.com + T_a_b[:3, 3], R @ self.inertia @ R.T)


def combined(bodies: Sequence[Inertial]) -> Inertial:
    """Return the mass properties of bodies, all given in one frame, welded together."""
    mass = sum(b.mass for b in bodies)
    com = sum((b.mass * b.com for b in bodies), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for b in bodies:
        r = b.com - com
        inertia += b.inertia + b.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return Inertial(mass, com, inertia)
