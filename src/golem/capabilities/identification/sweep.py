"""The motion that a robot is identified by: in the hoist every joint swings by itself, at speeds of its own."""

from __future__ import annotations

import numpy as np

from golem.capabilities.legs.base import Envelope, LocomotionCommand
from golem.capabilities.legs.gait import GaitConfig
from golem.hardware.servo.gains import default_gains
from golem.interfaces.payloads import ArmCommand, LegCommand
from golem.types import LEGS, NUM_JOINTS, UPPER, Array, BaseEstimate, LowState

# Middle and swing of each joint [rad], left side. Feet stay apart, hands beside the trunk and off the thighs; the torso
# turns, or a lean of the IMU could not be told from the zeros of the legs.
_LEG = ((0.05, 0.25), (-0.25, 0.4), (0.2, 0.16), (0.6, 0.5), (-0.15, 0.35), (0.0, 0.15))
_ARM = ((0.0, 0.5), (0.6, 0.3), (0.0, 0.5), (1.1, 0.5), (0.0, 0.8), (0.0, 0.35), (0.0, 0.8))
_MIRROR = (*(1,) * 6, -1, 1, -1, 1, 1, -1, *(1,) * 8, 1, -1, -1, 1, -1, 1, -1)
MIDDLE, SWING = np.array([*_LEG, *_LEG, (0.0, 0.8), *_ARM, *_ARM]).T * [_MIRROR, (1,) * NUM_JOINTS]
# Golden-ratio steps keep all pairs of frequencies apart [Hz]; the second sine tells friction from damping.
_SLOW = 0.16 + 0.2 * (np.arange(NUM_JOINTS) * 0.618034 % 1.0)
_GAINS = default_gains()
EASE = 4.0
"""Time in which the swing grows [s]."""


def swing(t: float, start: Array) -> Array:
    """Return the (27,) joint targets [rad] at `t` [s] after the joints were at `start` (27,) [rad]."""
    share, phase = 0.5 - 0.5 * np.cos(np.pi * min(t / EASE, 1.0)), 2.0 * np.pi * _SLOW * t
    return start + share * (MIDDLE + SWING * (0.7 * np.sin(phase) + 0.3 * np.sin(2.7 * phase)) - start)


class LegSweep:
    """Swings the legs of a robot in the hoist; see `LowerBody`. It follows no twist."""

    requires, envelope, gait = ("hoist",), Envelope(), GaitConfig(start="never")
    rate, latency = 500.0, 0.0
    _t, _start = 0.0, MIDDLE

    def reset(self, state: LowState) -> None:
        self._t, self._start = 0.0, state.q.copy()

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        self._t += dt
        return LegCommand(swing(self._t, self._start)[LEGS], _GAINS.kp[LEGS].copy(), _GAINS.kd[LEGS].copy())


class ArmSweep:
    """Swings torso and arms; see `UpperBody`. It goes to no palm target."""

    rate, latency = 500.0, 0.0
    _t, _start = 0.0, MIDDLE

    def reset(self, q: Array) -> None:
        self._t, self._start = 0.0, q.copy()

    def step(self, targets_left: Array | None, targets_right: Array | None, q_measured: Array, dt: float) -> ArmCommand:
        self._t += dt
        return ArmCommand(swing(self._t, self._start)[UPPER], np.zeros(2), np.zeros(2), False)
