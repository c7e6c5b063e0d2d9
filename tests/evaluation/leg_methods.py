"""Lower bodies for tests of the judges: cheap, and of known skill."""

from __future__ import annotations

import numpy as np

from golem.capabilities.legs.base import Envelope, LocomotionCommand
from golem.capabilities.legs.hold import HoldConfig, JointHold
from golem.interfaces.payloads import LegCommand
from golem.types import BaseEstimate, LowState


class Stiff(JointHold):
    """Holds the crouch with stiff joints and steers with its ankles: stands unless pushed out of its soles."""

    def __init__(self) -> None:
        stiff = (500.0,) * 6
        super().__init__(HoldConfig(stance="crouch", kp=stiff, kd=(12.0,) * 6, rate=200.0))

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        command = super().step(state, base, motion, dt)
        x, y = base.T_odom_base[:2, 3]
        tau = np.zeros(12)
        # An inverted pendulum of 67 kg and 0.9 m needs 330 N m per metre of each ankle; twice that for a margin.
        tau[[4, 10]] = 600.0 * x + 120.0 * base.velocity[0]
        tau[[5, 11]] = -300.0 * y - 60.0 * base.velocity[1]
        return LegCommand(command.q, command.kp, command.kd, np.clip(tau, -200.0, 200.0))


class Limp(JointHold):
    """Lets go."""

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        zero = np.zeros(12)
        return LegCommand(state.q[:12].copy(), zero, zero, zero)


class Broken(Stiff):
    """Breaks its contract after two seconds."""

    envelope = Envelope(vx=(-0.5, 0.5))

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        if state.t > 2.0:
            raise ValueError("my bug")
        return super().step(state, base, motion, dt)
