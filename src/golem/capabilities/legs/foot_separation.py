"""Keeps a foot that swings beside the other one.

Shoved to a side, a robot that walks may set a foot down on the other one or across it, because its policy's targets say
so or because the leg lags behind them. Seen coming, it is prevented at one joint: the hip roll of the leg that swings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from golem.capabilities.legs.gait import Bools
from golem.interfaces.payloads import LegCommand
from golem.robots.model.leg_dynamics import LEG, LegDynamics
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, LowState

_ROLL = JOINT_NAMES.index("left_hip_roll_joint")
_Y = 1


@dataclass(frozen=True, slots=True)
class FootSeparationConfig:
    """Options of `FootSeparation`.

    Attributes:
        minimum: distance of the soles' centres across base_link below which the swinging leg is led outward [m]: soles
            are 0.08 m wide. Twice as much worsened the turning of a robot that walks fast and askew.
        lead: how far ahead it is extrapolated from how the feet move now [s]: what a leg needs to answer.
        gain: change of the hip roll's target per angle that is missing: the leg lags behind it by most of it.
        maximum: largest change [rad].
    """

    minimum: float = 0.08
    lead: float = 0.1
    gain: float = 4.0
    maximum: float = 0.8


class FootSeparation:
    """The correction of one robot's leg targets."""

    def __init__(self, config: FootSeparationConfig | None = None) -> None:
        """Follow `config`."""
        self.config = config or FootSeparationConfig()
        self._legs = LegDynamics()

    def step(self, command: LegCommand, state: LowState, swings: Bools) -> LegCommand:
        """Return what the legs are told instead of `command`.

        Args:
            command: of the controller.
            state: measured joints.
            swings: (2,) whether the left and the right leg swing, and carry no load.
        """
        if not swings.any():
            return command
        config, legs = self.config, self._legs
        legs.update(state.q[LEGS], state.dq[LEGS])
        across = legs.soles[:, _Y] + config.lead * legs.twists[:, _Y]
        missing = config.minimum - float(across[0] - across[1])
        if missing <= 0.0:
            return command
        lever = legs.jacobians[:, _Y, _ROLL]
        change = np.clip(config.gain * missing / lever, -config.maximum, config.maximum) * swings
        q = command.q.copy()
        q[_ROLL::LEG] += (1.0, -1.0) * change
        return replace(command, q=q)
