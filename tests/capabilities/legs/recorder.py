"""A robot that stands in its crouch, and a controller that remembers what it was asked."""

from __future__ import annotations

import numpy as np

from golem.capabilities.legs.base import Envelope, LocomotionCommand
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.hold import STANCES
from golem.interfaces.payloads import LegCommand
from golem.types import LEGS, NUM_JOINTS, BaseEstimate, Imu, LowState


class Recorder:
    """A controller that always says the same and remembers every state, motion and time step."""

    def __init__(
        self,
        rate: float = 50.0,
        envelope: Envelope | None = None,
        gait: GaitConfig | None = None,
        target: float = 0.0,
        stiffness: float = 100.0,
        silent: int = 0,
    ) -> None:
        """Ask for joints at `target` with `stiffness`, after `silent` ticks of damping only."""
        self.rate, self.latency = rate, 0.0
        self.envelope = envelope or Envelope((-0.4, 0.8), (-0.3, 0.3), (-0.6, 0.6))
        self.gait = gait or GaitConfig()
        self.target, self.stiffness, self.silent = target, stiffness, silent
        self.motions: list[LocomotionCommand] = []
        self.steps: list[float] = []
        self.resets = 0

    @property
    def started(self) -> bool:
        return len(self.steps) > self.silent

    def reset(self, state: LowState) -> None:
        self.resets += 1

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        self.motions.append(motion)
        self.steps.append(dt)
        stiffness = self.stiffness if self.started else 0.0
        return LegCommand(np.full(12, self.target), np.full(12, stiffness), np.full(12, 2.0), np.zeros(12))


def crouching() -> LowState:
    """The state of a robot that stands still and upright."""
    q = np.zeros(NUM_JOINTS)
    q[LEGS] = np.tile(STANCES["crouch"], 2)
    imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))
    return LowState(0.0, q, np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS), imu)


def still() -> BaseEstimate:
    """The estimate of a base at rest."""
    return BaseEstimate(0.0, np.eye(4), height=0.92, contact=np.ones(2))
