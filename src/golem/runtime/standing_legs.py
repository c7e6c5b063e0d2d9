"""A stop that does not drop the robot: the gate's own controller stands on the legs while the arms damp.

It runs inside the gate's process and needs nothing but the state, so it is there when the stack is not. It gets the
legs only while state and legs are sound (`gate.check` decides), and its commands are limited like all others.
"""

from __future__ import annotations

import math

import numpy as np

from golem import registry
from golem.capabilities.legs.locomotion import Locomotion
from golem.hardware.estimator.random_walk_kf import RandomWalkKF
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.base import HasGantry
from golem.runtime.contract_check import ContractCheck
from golem.runtime.executor import Node
from golem.runtime.nodes import moving
from golem.types import LEGS, NUM_JOINTS, TICK, Array, LowCommand, LowState

READY = 1.6
"""Time from the gate's activation to the release [s]: the servo's ramp, after which the arms hang still, and a bit."""

FOUND = 0.5
"""Time from the release within which the estimator must have found a foot on the floor [s]: who balances by an
estimate of nothing falls later, and nobody would say why."""


class GantryReleaseNode(Node):
    """Releases the band once the gate is active, the servo stiff, and a leg controller at work.

    Raises, from `step`:
        ModuleFault: the estimator is still without an estimate some time after the release.
    """

    def __init__(self, bus: Bus, robot: HasGantry, contract: ContractCheck, estimator: ContractCheck) -> None:
        """Watch `bus` for `robot`, whose base `estimator` watches."""
        self._bus, self._robot, self._contract, self._estimator = bus, robot, contract, estimator
        self._waiting_since, self._released, self._found = 0.0, math.inf, False
        self.period = 0.01

    def step(self, t: float) -> None:
        """Release the band when all is ready; a stop before that starts the wait anew."""
        if not self._robot.on_gantry:
            if not self._found:
                self._look(t)
            return
        legs = self._bus.latest(topics.LEG_COMMAND)
        if not moving(self._bus) or legs is None or not (legs.kp.any() or np.any(legs.tau)):
            self._waiting_since = t
        elif t - self._waiting_since >= READY:
            self._contract.call(self._robot.release)
            self._released, self._found = t, False

    def _look(self, t: float) -> None:
        """Look whether the estimator finds the floor."""
        base = self._bus.latest(topics.BASE)
        self._found = base is not None and not base.stale
        if self._found and self._released < math.inf:
            self.period = math.inf  # its work is done
        if not self._found and t - self._released > FOUND:
            raise self._estimator.fault(f"it found no foot on the floor within {FOUND:g} s of the release")


LEGS_USED = "almi"
"""The lower body that stands: the shipped one, whose standing network takes over from its walk and takes pushes."""


class StandingLegs:
    """A standing controller with an estimator of its own."""

    def __init__(self) -> None:
        """Load the shipped legs. Raises ConfigError: this installation lacks them."""
        self._locomotion = Locomotion(registry.create("lower_body", LEGS_USED, {}))
        self._estimator = RandomWalkKF()
        self._kp, self._tau = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)

    def start(self, state: LowState) -> None:
        """Take the legs of the robot in `state`."""
        self._estimator.reset(state)
        self._locomotion.reset(state)

    def step(self, state: LowState, damping: Array) -> LowCommand:
        """Return the command in `state`: legs that stand, others with `damping` (27,). Raises GolemError: it failed."""
        legs = self._locomotion.step(state, self._estimator.step(state, TICK), None, TICK)
        q, kp, kd, tau = state.q.copy(), self._kp.copy(), damping.copy(), self._tau.copy()
        q[LEGS], kp[LEGS], kd[LEGS] = legs.q, legs.kp, legs.kd
        if legs.tau is not None:
            tau[LEGS] = legs.tau
        return LowCommand(state.t, q, np.zeros(NUM_JOINTS), tau, kp, kd)
