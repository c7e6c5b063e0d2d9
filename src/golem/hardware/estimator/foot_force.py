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

from golem.hardware.estimator import feet_kernel
from golem.robots.model.leg_dynamics import LEG, LegDynamics
from golem.types import LEGS, Array, LowState


@dataclass(frozen=True, slots=True)
class FootForceConfig:
    """Options of `FootForce`.

    Attributes:
        lag: time constant of the low-pass [s].
        damping: lever arm below which a force is not resolved [m]: the stretched knee passes the weight on without
            any torque, and noise over zero is no force.
        foot: lever arm at which a moment on the sole weighs as much as a force [m].
    """

    lag: float = 0.005
    damping: float = 0.01
    foot: float = 0.1


class FootForce:
    """The wrenches under both feet of one robot."""

    def __init__(self, config: FootForceConfig) -> None:
        """Start with nothing known."""
        self.config = config
        moment = config.damping / config.foot
        self._floor: Array = np.repeat([config.damping, moment], 3) ** 2
        self._torque: Array | None = None
        self._momentum: Array = np.zeros((2, LEG))

    def reset(self) -> None:
        """Forget; the next sample is taken as if nothing had moved before."""
        self._torque = None

    def step(self, legs: LegDynamics, state: LowState, field: Array, dt: float) -> Array:
        """Return the (2, 6) wrench on the left and the right foot: force [N], moment about the sole's centre [N m].

        Args:
            legs: updated with the joints of `state`; the wrench has its axes, those of base_link.
            state: its torques are used.
            field: (3,) gravity in base_link [m/s^2].
            dt: time since the previous sample [s].
        """
        torque = legs.gravity(state.q[LEGS], field) - state.tau[LEGS].reshape(2, LEG)
        if self._torque is None:
            self._torque, self._momentum = torque, legs.momentum
        lag = self.config.lag
        share = dt / (lag + dt)
        self._torque = self._torque + share * (torque - self._torque)
        self._momentum = self._momentum + share * (legs.momentum - self._momentum)
        external = self._torque + (legs.momentum - self._momentum) / lag
        # Least squares, damped: J J^T w = J tau.
        return feet_kernel.wrenches(legs.jacobians, external, self._floor)
