"""The wrench of the ground on each foot, from the torques of the leg's six joints.

With base_link as the frame of reference and h(q) the weight of the leg, tau + J^T w = d(M dq)/dt + h(q): the joints
feel the ground's wrench w through the transposed Jacobian of the sole, six equations for six unknowns. What is left
out is the Coriolis term and the acceleration of base_link.

A leg that swings feels its own inertia (mostly the motors' armature) as a force of several hundred newtons, so
d(M dq)/dt is not left out: both sides pass the same low-pass, whose response to a derivative needs no acceleration
measured (the momentum observer of De Luca et al., IROS 2006).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.hardware.estimator.feet_kernel import wrenches
from golem.kernels import njit
from golem.native import Record
from golem.robots.model.leg_kernel import LEG
from golem.types import Array


@dataclass(frozen=True, slots=True)
class FootForceConfig:
    """Options of `foot_wrenches`.

    Attributes:
        lag: time constant of the low-pass [s].
        damping: lever arm below which a force is not resolved [m]: the stretched knee passes the weight on without
            any torque, and noise over zero is no force.
        foot: lever arm at which a moment on the sole weighs as much as a force [m].
    """

    lag: float = 0.005
    damping: float = 0.01
    foot: float = 0.1

    def floor(self) -> Array:
        """Return the (6,) squared damping of forces and moments."""
        return np.repeat([self.damping, self.damping / self.foot], 3) ** 2


FOOT_FORCE = np.dtype(
    [("lag", "f8"), ("floor", "f8", (6,)), ("torque", "f8", (2, LEG)), ("momentum", "f8", (2, LEG)), ("begun", "i8")]
)
"""Options and memory of `foot_wrenches`; not `begun`, the next sample is taken as if nothing had moved before."""


@njit(cache=True, nogil=True)
def foot_wrenches(m: Record, motion: Record, tau: Array, dt: float) -> Array:
    """Return the (2, 6) wrench on the left and the right foot: force [N], moment about the sole's centre [N m].

    Args:
        m: a `FOOT_FORCE`.
        motion: of the legs at this sample, a `LEG_MOTION`; the wrench has its axes, those of base_link.
        tau: of all motors [N m]; the legs are the first twelve.
        dt: time since the previous sample [s].
    """
    share, external = dt / (m.lag + dt), np.empty((2, LEG))
    for k in range(2):
        for i in range(LEG):
            torque, momentum = motion.gravity[k, i] - tau[LEG * k + i], motion.momentum[k, i]
            if not m.begun:
                m.torque[k, i], m.momentum[k, i] = torque, momentum
            m.torque[k, i] += share * (torque - m.torque[k, i])
            m.momentum[k, i] += share * (momentum - m.momentum[k, i])
            external[k, i] = m.torque[k, i] + (momentum - m.momentum[k, i]) / m.lag
    m.begun = 1
    # Least squares, damped: J J^T w = J tau.
    return wrenches(motion.jacobians, external, m.floor)
