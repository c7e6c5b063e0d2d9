"""Holds the legs in one posture: the lower body of a robot that hangs in a hoist, or is kept upright by its band."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from golem.capabilities.legs.base import Envelope, LocomotionCommand
from golem.capabilities.legs.gait import GaitConfig
from golem.errors import ConfigError, unknown_name
from golem.interfaces.payloads import LegCommand
from golem.robots.model.leg_kinematics import leg_poses, sole_centers
from golem.types import LEGS, Array, BaseEstimate, LowState

STANCES: dict[str, tuple[float, ...]] = {
    # Per leg: hip yaw, hip pitch, hip roll, knee, ankle pitch, ankle roll [rad].
    "straight": (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    # Unitree's RL example and the HAMS policies start from this one.
    "stand": (0.0, -0.16, 0.0, 0.36, -0.2, 0.0),
    # ALMI's default posture.
    "crouch": (0.0, -0.4, 0.0, 0.8, -0.4, 0.0),
}
"""Named postures of one leg; both legs take the same."""
_STRAIGHT = np.zeros(12)
_LINK = 0.4
"""Length of thigh and of shank [m]."""


def height_of(q: Array) -> float:
    """Return the height of base_link above the soles [m] at the leg joints `q` (12,) [rad]."""
    return -float(sole_centers(*leg_poses(q))[:, 2].mean())


def squat(height: float) -> Array:
    """Return the (12,) posture in which base_link is `height` above level soles under the hips [m], its knees bent."""
    bent = math.acos(min(max(1.0 - (height_of(_STRAIGHT) - height) / (2.0 * _LINK), 0.0), 1.0))
    return np.tile((0.0, -bent, 0.0, 2.0 * bent, -bent, 0.0), 2)


def standing(own: float, heights: tuple[float, float] | None) -> Envelope:
    """Return the envelope of legs that stand at their `own` height, or at any of `heights`, lowest and highest [m].

    Raises ConfigError: no robot stands so; see `Envelope`.
    """
    return Envelope() if heights is None else Envelope(height=(min(heights[0], own), own, max(heights[1], own)))


@dataclass(frozen=True, slots=True)
class HoldConfig:
    """Options of `JointHold`.

    Attributes:
        stance: a name in `STANCES`.
        speed: how fast the joints move from where they are to the stance [rad/s].
        kp: stiffness of hip yaw, hip pitch, hip roll, knee, ankle pitch, ankle roll [N m/rad].
            These values and those of kd are from correlllab/HAMS walk.yaml.
        kd: damping of the same six joints [N m s/rad].
        standing: whether the legs carry the robot; else they hang, and the servo carries their weight.
        rate: ticks per second [Hz].
    """

    stance: str = "stand"
    speed: float = 0.5
    kp: tuple[float, ...] = (200.0, 200.0, 200.0, 300.0, 40.0, 40.0)
    kd: tuple[float, ...] = (2.5, 2.5, 2.5, 4.0, 2.0, 2.0)
    standing: bool = False
    rate: float = 50.0


class JointHold:
    """Moves the legs to a stance and keeps them there, whatever the twist; a robot on its feet falls with it."""

    balances = False

    def __init__(self, config: HoldConfig | None = None) -> None:
        """Look up the stance. Raises ConfigError: it is unknown, not six gains each, or no positive speed."""
        self.config = config or HoldConfig()
        if self.config.stance not in STANCES:
            raise unknown_name("stance", self.config.stance, STANCES)
        if len(self.config.kp) != 6 or len(self.config.kd) != 6:
            raise ConfigError(
                "Hold needs six values of kp and six of kd: hip yaw, pitch, roll, knee, ankle pitch, roll."
            )
        if not self.config.speed > 0.0:
            raise ConfigError(f"Hold needs a positive speed [rad/s], not {self.config.speed}.")
        self.rate = self.config.rate
        self.latency = 0.0
        self.envelope = Envelope()
        self.gait = GaitConfig(start="never")
        self._goal: Array = np.tile(np.asarray(STANCES[self.config.stance]), 2)
        self._kp: Array = np.tile(np.asarray(self.config.kp), 2)
        self._kd: Array = np.tile(np.asarray(self.config.kd), 2)
        self._tau = np.zeros(LEGS.stop) if self.config.standing else None
        self._q: Array = self._goal.copy()

    @staticmethod
    def carries(options: Mapping[str, object]) -> bool:
        """Return whether legs with these options of the stack file carry the robot."""
        return bool(options.get("standing"))

    def reset(self, state: LowState) -> None:
        """Start from the measured leg joints of `state`."""
        self._q = np.array(state.q[LEGS], dtype=np.float64)

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        """Move the targets towards the stance by at most `speed * dt`; see `LowerBody.step`."""
        reach = self.config.speed * dt
        self._q = self._q + np.clip(self._goal - self._q, -reach, reach)
        return LegCommand(self._q.copy(), self._kp.copy(), self._kd.copy(), self._tau)
