"""A stop that does not drop the robot: the gate's own controller stands on the legs while the arms damp.

It runs inside the gate's process and needs nothing but the state, so it is there when the stack is not. It gets the
legs only while state and legs are sound (`gate.check` decides), and its commands are limited like all others.
"""

from __future__ import annotations

import numpy as np

from golem import registry
from golem.capabilities.legs.locomotion import Locomotion
from golem.hardware.estimator.random_walk_kf import RandomWalkKF
from golem.types import LEGS, NUM_JOINTS, TICK, Array, LowCommand, LowState

LEGS_USED = "almi"
"""The lower body that stands: the shipped one, whose standing network takes over from its walk and takes pushes."""


class StandingLegs:
    """A standing controller with an estimator of its own."""

    def __init__(self) -> None:
        """Load the shipped legs.

        Raises:
            ConfigError: this installation lacks them.
        """
        self._locomotion = Locomotion(registry.create("lower_body", LEGS_USED, {}))
        self._estimator = RandomWalkKF()
        self._kp, self._tau = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)

    def start(self, state: LowState) -> None:
        """Take the legs of the robot in `state`."""
        self._estimator.reset(state)
        self._locomotion.reset(state)

    def step(self, state: LowState, damping: Array) -> LowCommand:
        """Return what the motors are told in `state`: legs that stand, and `damping` (27,) for all others.

        Raises:
            GolemError: the controller failed.
        """
        base = self._estimator.step(state, TICK)
        legs = self._locomotion.step(state, base, None, TICK)
        q, kp, kd, tau = state.q.copy(), self._kp.copy(), damping.copy(), self._tau.copy()
        q[LEGS], kp[LEGS], kd[LEGS] = legs.q, legs.kp, legs.kd
        if legs.tau is not None:
            tau[LEGS] = legs.tau
        return LowCommand(state.t, q, np.zeros(NUM_JOINTS), tau, kp, kd)
