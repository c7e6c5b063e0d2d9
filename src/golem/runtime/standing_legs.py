"""A stop that does not drop the robot: the gate's own controller stands on the legs while the arms damp.

It runs inside the gate's process and needs nothing but the state, so it is there when the stack is not. It gets the
legs only while state and legs are sound (`gate.check` decides), and its commands are limited like all others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from golem import registry
from golem.capabilities.legs.locomotion import Locomotion
from golem.errors import GolemError
from golem.hardware.estimator.random_walk_kf import RandomWalkKF
from golem.hardware.safety.base import GateInputs
from golem.hardware.safety.gate import Gate
from golem.hardware.safety.memory import GateMemory, GateResult
from golem.interfaces.payloads import GateState
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


class StandingGate:
    """The gate, with a controller behind it that can stand.

    Attributes:
        gate: the gate.
    """

    def __init__(self, gate: Gate, make: Callable[[], StandingLegs] | None) -> None:
        """Give the legs to what `make` makes, at the first stop that leaves them sound; None always damps."""
        self.gate, self._make = gate, make
        self._legs: StandingLegs | None = None

    @property
    def memory(self) -> GateMemory:
        """What the gate remembers."""
        return self.gate.memory

    def prepare(self) -> None:
        """Make the controller now: where the wall clock counts, it must not take its time at the stop."""
        if self._make is not None and self._legs is None:
            self._legs = self._make()

    def step(self, inputs: GateInputs) -> GateResult:
        """Run the gate, and the legs if they are the controller's."""
        before = self.gate.memory
        standing = None
        if before.mode is GateState.STOP2 and self._legs is not None and inputs.state is not None:
            try:
                standing = self._legs.step(inputs.state, self.gate.limits.damping)
            except GolemError:
                standing = None  # the gate then damps
        result = self.gate.step(replace(inputs, stands=self._make is not None, standing=standing))
        if result.state is GateState.STOP2 and before.mode is not GateState.STOP2:
            self.prepare()
            assert self._legs is not None and result.memory.state is not None
            self._legs.start(result.memory.state)
        return result
