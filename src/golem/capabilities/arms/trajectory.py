"""Follows a timed joint trajectory; the one follower for all upper-body controllers, live and in lock-step.

Between two points with velocities the path is the cubic Hermite polynomial, which meets both; without velocities it is
the straight line. On the way to a first point that is not due at once it starts from rest.
"""

from __future__ import annotations

import functools

import numpy as np

from golem.capabilities.arms.base import NUM_UPPER, TargetError, check_dt
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces.payloads import ArmCommand, JointTrajectory
from golem.robots.model.table import JOINT_NAMES
from golem.types import UPPER, Array


def interpolate(times: Array, points: Array, velocities: Array | None, s: Array) -> Array:
    """Return (m, n) the joints of a trajectory at `s` (m,) [s]: cubic Hermite, or straight without velocities.

    Args:
        times: (k,) of its points, increasing.
        points: (k, n).
        velocities: (k, n), or None.
        s: when; before the first point it is that point, and after the last one that one.
    """
    if len(times) == 1:
        return np.repeat(points, len(s), axis=0)
    s = np.clip(s, times[0], times[-1])
    i = np.clip(np.searchsorted(times, s, side="right") - 1, 0, len(times) - 2)
    span = (times[i + 1] - times[i])[:, None]
    u = (s - times[i])[:, None] / span
    a, b = points[i], points[i + 1]
    if velocities is None:
        return a + u * (b - a)
    va, vb = span * velocities[i], span * velocities[i + 1]
    return a + u * va + u**2 * (3.0 * (b - a) - 2.0 * va - vb) + u**3 * (2.0 * (a - b) + va + vb)


FASTEST = 0.9
"""Share of the gate's slew rate, which clips what is faster, that is used."""
NEAR = 0.1
"""How far the joints may be from a first point that is due at once [rad] [own: servo lag and sag of a laden arm]."""


class TrajectoryFollower:
    """Turns a joint trajectory into targets `q` (15,) [rad] tick by tick, within limits of position and velocity."""

    def __init__(self) -> None:
        self._lower, self._upper, self._speed = gate_limits()
        self.q: Array = np.zeros(NUM_UPPER)
        self._t = 0.0
        self._times: Array = np.zeros(1)
        self._points: Array = self.q[None]
        self._velocities: Array | None = None

    def start(self, trajectory: JointTrajectory, q: Array) -> None:
        """Follow `trajectory`, which `check_trajectory` has passed, from the joint targets `q` (15,) [rad] on."""
        self.q = q.copy()
        self._t, self._times = trajectory.t, trajectory.times
        self._points, self._velocities = trajectory.q, trajectory.dq
        if self._times[0] > 0.0:
            self._times = np.concatenate(([0.0], self._times))
            self._points = np.vstack((q, self._points))
            if self._velocities is not None:
                self._velocities = np.vstack((np.zeros(NUM_UPPER), self._velocities))

    def step(self, t: float, dt: float) -> ArmCommand:
        """Return the targets at time `t` [s], `dt` [s] after the previous ones; after the end those of the end.

        A target that position or velocity limits put out of reach is approached as fast as they allow; the command is
        then `limited`. Raises TargetError: `dt` is not positive.
        """
        check_dt(dt)
        wanted = interpolate(self._times, self._points, self._velocities, np.array([t - self._t]))[0]
        room = self._speed * dt
        # A joint that starts beyond its range comes back at its speed.
        inside = np.clip(wanted, self._lower, self._upper)
        self.q = np.clip(inside, self.q - room, self.q + room)
        return ArmCommand(self.q.copy(), np.zeros(2), np.zeros(2), bool(np.abs(self.q - wanted).max() > 1e-9))


@functools.cache
def gate_limits() -> tuple[Array, Array, Array]:
    """Return (15,) the range of the joints and their speed that the safety gate lets through [rad, rad/s]."""
    gate = SafetyLimits.from_profile()
    return gate.lower[UPPER], gate.upper[UPPER], FASTEST * gate.slew[UPPER]


def check_trajectory(trajectory: JointTrajectory, q: Array) -> None:
    """Check that arms whose joints are at `q` (15,) [rad] can follow `trajectory`.

    Raises TargetError: shapes or times make no sense, a number is not finite, or a point is beyond the position limits,
    too fast to get to, or, due at once, not where the arms are.
    """
    times, points, velocities = trajectory.times, trajectory.q, trajectory.dq
    n = len(times)
    for name, array in (("q", points), ("dq", velocities)):
        if array is not None and array.shape != (n, NUM_UPPER):
            raise TargetError(f"{name} of a trajectory of {n} points has shape {array.shape}, not ({n}, {NUM_UPPER}).")
    if n == 0 or times.shape != (n,) or times[0] < 0.0 or not (np.diff(times) > 0.0).all():
        raise TargetError("A trajectory has at least one point, and its times increase from zero or a positive one.")
    finite = [np.isfinite(array).all() for array in (times, points, velocities) if array is not None]
    if not all(finite):
        raise TargetError("A trajectory contains NaN or infinity.")
    lower, upper, fastest = gate_limits()
    _check_range(points, lower, upper, "is sent to", "rad")
    if times[0] > 0.0:
        times, points = np.concatenate(([0.0], times)), np.vstack((q, points))
    else:
        near = np.full(NUM_UPPER, NEAR)
        _check_range(points[:1] - q, -near, near, "is to start at once with an offset of", "rad")
    speeds = np.diff(points, axis=0) / np.diff(times)[:, None]
    for asked in (speeds, velocities):
        if asked is not None:
            _check_range(asked, -fastest, fastest, "is to move at", "rad/s")


def _check_range(values: Array, lower: Array, upper: Array, what: str, unit: str) -> None:
    """Raise for the first joint one of whose `values` (n, 15) is outside its range."""
    outside = (values < lower) | (values > upper)
    if outside.any():
        joint = int(outside.any(axis=0).argmax())
        value = values[int(outside[:, joint].argmax()), joint]
        name, span = JOINT_NAMES[UPPER][joint], f"{lower[joint]:.3g} to {upper[joint]:.3g}"
        raise TargetError(
            f"The trajectory cannot be followed: {name} {what} {value:.3g} {unit}; possible: {span} {unit}."
        )
