"""How far an odometry is off on a recorded walk."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from golem.capabilities.odometry.base import OdometryEstimate
from golem.types import Array, PlanarPose

ANCHOR = 1.0
"""Time over whose mean odometry and truth are laid on one another [s]."""


@dataclass(frozen=True, slots=True)
class PoseTrack:
    """What an odometry said after every scan, where it said anything, and what was true then.

    Attributes:
        t: (n,) times [s].
        T: (n, 4, 4) poses of base_link by the odometry.
        covariance: (n, 6, 6) of them.
        true: (n, 4, 4) true poses.
    """

    t: Array
    T: Array
    covariance: Array
    true: Array

    @classmethod
    def of(cls, told: list[tuple[OdometryEstimate, Array]]) -> PoseTrack:
        """Return the track of estimates, each with the true (4, 4) pose of its time."""
        return cls(
            np.array([e.t for e, _ in told]),
            np.array([e.T_odom_base for e, _ in told]),
            np.array([e.covariance for e, _ in told]),
            np.array([true for _, true in told]),
        )

    def anchored(self, until: float) -> PoseTrack:
        """Return the track with odometry and truth each in the frame of its mean pose on the floor before a time.

        The mean is over the last second before `until` [s], or over the first second that there is.
        """
        first = self.t[0]
        at: NDArray[np.bool_] = (self.t > until - ANCHOR) & (self.t <= until)
        if not at.any():
            at = self.t <= first + ANCHOR
        own, true = (_in_mean(T, at) for T in (self.T, self.true))
        turn = np.zeros((6, 6))
        R = own[0][:3, :3] @ self.T[0][:3, :3].T
        turn[:3, :3] = turn[3:, 3:] = R
        return PoseTrack(self.t, own, turn @ self.covariance @ turn.T, true)


def ate(track: PoseTrack) -> float:
    """Return the absolute trajectory error [m]: the RMS of the distance after the best rigid alignment."""
    own, true = track.T[:, :3, 3], track.true[:, :3, 3]
    a, b = own - own.mean(axis=0), true - true.mean(axis=0)
    u, _, vt = np.linalg.svd(b.T @ a)
    R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return float(np.sqrt((((a @ R.T) - b) ** 2).sum(axis=1).mean()))


def end_error(track: PoseTrack) -> tuple[float, float, float]:
    """Return how far an anchored track ends beside the truth on the floor [m], above it [m], and in heading [rad]."""
    off = track.T[-1, :3, 3] - track.true[-1, :3, 3]
    own, true = (PlanarPose.of(T[-1]) for T in (track.T, track.true))
    return float(np.hypot(off[0], off[1])), float(off[2]), math.remainder(own.yaw - true.yaw, math.tau)


def range_and_bearing(track: PoseTrack) -> tuple[float, float] | None:
    """Return how much too far from its beginning an anchored track ends [m], and in a direction how much off [rad].

    How far it is needs no direction ahead; the other error says how well that of base_link was known at the beginning.
    None for a walk that ends where it began, whose end has no direction.
    """
    own, true = (complex(*T[-1, :2, 3]) for T in (track.T, track.true))
    if abs(true) < 1.0 or not own:
        return None
    return abs(own) - abs(true), cmath.phase(own / true)


def nees(track: PoseTrack, since: float) -> tuple[float, float] | None:
    """Return the mean squared error of an anchored track over its covariance, per degree of freedom.

    Args:
        track: the track.
        since: time from which it counts [s].

    Returns:
        Of the place, and of the heading: 1 where the covariance is honest, more where it is too small. None where there
        is no covariance.
    """
    chosen = (track.t >= since) & np.isfinite(track.covariance).all(axis=(1, 2))
    if not chosen.any():
        return None
    T, true, P = track.T[chosen], track.true[chosen], track.covariance[chosen]
    off = T[:, :3, 3] - true[:, :3, 3]
    R = T[:, :3, :3] @ true[:, :3, :3].transpose(0, 2, 1)
    heading = Rotation.from_matrix(R).as_rotvec()[:, 2]
    place = np.einsum("ni,nij,nj->n", off, np.linalg.inv(P[:, :3, :3]), off) / 3.0
    return float(place.mean()), float((heading**2 / P[:, 5, 5]).mean())


def _in_mean(T: Array, chosen: NDArray[np.bool_]) -> Array:
    """Return poses (n, 4, 4) in the level frame of the mean place and heading of those `chosen`."""
    first = T[chosen]
    xyz, yaw = first[:, :3, 3].mean(axis=0), np.arctan2(first[:, 1, 0], first[:, 0, 0])
    heading = math.atan2(np.sin(yaw).mean(), np.cos(yaw).mean())
    frame = PlanarPose(float(xyz[0]), float(xyz[1]), heading).matrix()
    frame[2, 3] = xyz[2]
    return np.linalg.inv(frame) @ T
