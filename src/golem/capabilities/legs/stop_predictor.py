"""Where a robot that steps would come to rest: above its footprints, as it stood before it set off.

A body that walks or marks time sways over its feet and leans otherwise than one that stands; the feet stay where they
are when it stops. So a navigator that looks at the body stops it beside the goal, by 3 cm and some degrees.
"""

from __future__ import annotations

import math

import numpy as np

from golem.kernels import njit
from golem.native import Record, new_record
from golem.types import Array, PlanarPose

SMOOTHING = 0.7
"""Time constant of the filter on what is predicted [s]: a period of the gait."""
STOOD = 0.5
"""Time without a step after which the robot stands as it does [s]."""
LOADED = 0.5
"""Probability of contact from which a foot counts as planted."""

TAU = math.tau
REST = np.dtype(
    [
        *(("pose", "f8", (3,)), ("prints", "f8", (2, 3)), ("samples", "i8", (2,))),
        *(("stance", "f8", (3,)), ("known", "?"), ("stood", "f8")),
    ]
)
"""Planar poses, x, y, yaw each: the place of rest in base_link, footprints and how many samples each is the mean of,
base_link above the middle of the footprints once it is `known`; time without a step [s]."""


@njit(cache=True, nogil=True)
def planar(T: Array, out: Array) -> None:
    """Write what `PlanarPose.of` returns of `T` (4, 4) into `out` (3,)."""
    out[0], out[1], out[2] = T[0, 3], T[1, 3], math.atan2(T[1, 0], T[0, 0])


@njit(cache=True, nogil=True)
def _wrap(angle: float) -> float:
    return angle - TAU * round(angle / TAU)


@njit(cache=True, nogil=True)
def _to(a: Array, b: Array, out: Array) -> None:
    """Write what `PlanarPose.to` returns for (3,) poses into `out`."""
    c, s = math.cos(a[2]), math.sin(a[2])
    x, y = b[0] - a[0], b[1] - a[1]
    out[0], out[1], out[2] = c * x + s * y, c * y - s * x, _wrap(b[2] - a[2])


@njit(cache=True, nogil=True)
def _after(a: Array, b: Array, share: float, out: Array) -> None:
    """Write the pose `a` @ (`share` * `b`) into `out`; see `PlanarPose`."""
    c, s = math.cos(a[2]), math.sin(a[2])
    x, y = share * b[0], share * b[1]
    out[0], out[1], out[2] = a[0] + c * x - s * y, a[1] + s * x + c * y, _wrap(a[2] + share * b[2])


@njit(cache=True, nogil=True)
def _toward(a: Array, b: Array, share: float, out: Array) -> None:
    """Write what `PlanarPose.toward` returns into `out`, which may be `a`."""
    step = np.empty(3)
    _to(a, b, step)
    _after(a, step, share, out)


@njit(cache=True, nogil=True)
def step_rest(m: Record, here: Array, feet: Array, contact: Array, moving: bool, dt: float) -> None:
    """Do what `StopPredictor.step` does with `m`, a `REST`; `here` (3,) and `feet` (2, 3) are planar poses in odom."""
    for k in range(2):
        planted = not moving or contact[k] > LOADED
        # The mean over a stance, because a sole rolls and the estimate trembles; at rest the newest is the best.
        m.samples[k] = m.samples[k] + 1 if planted and moving else int(planted)
        if planted:
            _toward(m.prints[k], feet[k], 1.0 / m.samples[k], m.prints[k])
    middle, expected, step = np.empty(3), np.empty(3), np.empty(3)
    _toward(m.prints[0], m.prints[1], 0.5, middle)
    if not moving:
        m.pose[0] = m.pose[1] = m.pose[2] = 0.0
        m.stood += dt
        if m.stood > STOOD:
            m.known = True
            _to(middle, here, m.stance)
        return
    m.stood = 0.0
    if m.known:
        _after(middle, m.stance, 1.0, step)
        _to(here, step, expected)
        _toward(m.pose, expected, dt / (SMOOTHING + dt), m.pose)


class StopPredictor:
    """Remembers the footprints of one robot, and how it stands above them.

    Attributes:
        memory: (1,) of `REST`.
    """

    def __init__(self) -> None:
        """Begin without footprints: the robot is taken to stay where it is."""
        self.memory = new_record(REST)
        self._pose: Array = self.memory["pose"][0]

    @property
    def pose(self) -> PlanarPose:
        """The place of rest as seen from base_link."""
        return PlanarPose(*self._pose.tolist())

    def reset(self) -> None:
        """Forget everything."""
        self.memory[:] = np.zeros((), REST)

    def step(self, base: Array, feet: Array, contact: Array, moving: bool, dt: float) -> None:
        """Advance by `dt` [s].

        Args:
            base: (4, 4) pose of base_link in odom.
            feet: (2, 4, 4) poses of the soles in base_link, left and right.
            contact: (2,) probability that each foot carries load.
            moving: whether the robot walks or steps.
            dt: time since the previous step [s].
        """
        here, prints = np.empty(3), np.empty((2, 3))
        planar(base, here)
        for pose, foot in zip(prints, base @ feet, strict=True):
            planar(foot, pose)
        step_rest(self.memory[0], here, prints, contact, moving, dt)
