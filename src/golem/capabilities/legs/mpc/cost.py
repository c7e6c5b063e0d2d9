"""The cost of a rollout: the paper's residuals, squared, weighted and averaged over the horizon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.capabilities.legs.balance_errors import balance_errors
from golem.capabilities.legs.mpc.planning_model import Stance, Trajectories
from golem.types import Array


@dataclass(frozen=True, slots=True)
class CostConfig:
    """Weights of the squared residuals; each residual is divided by what makes it count as 1.

    Attributes:
        height: CoM height against that of the reference stance, 5 cm.
        velocity: horizontal CoM velocity, 0.2 m/s.
        orientation: tilt of base_link, 0.1 rad, and half as much its angular rate, 1 rad/s.
        capture: capture point against the middle of the feet, 5 cm.
        feet: feet against where they belong relative to each other, 5 cm.
        effort: motor torques against the motors' bounds, mean over the motors.
        posture: leg joints against those of the stance, 0.1 rad, mean over the joints.
    """

    height: float = 1.0
    velocity: float = 0.5
    orientation: float = 1.0
    capture: float = 2.0
    feet: float = 0.3
    effort: float = 3.0
    posture: float = 0.3


def cost(config: CostConfig, runs: Trajectories, stance: Stance, torque: Array) -> Array:
    """Return the (n,) costs of `runs`.

    Args:
        config: weights.
        runs: n rollouts of m steps.
        stance: the reference stance.
        torque: (12,) bounds of the motor torques [N m].
    """
    capture, misplaced = balance_errors(runs.R, runs.com, runs.com_velocity, runs.soles, stance.feet)
    height = runs.com[..., 2] - runs.soles[..., 2].min(axis=-1) - stance.com_height
    total = (
        config.height * (height / 0.05) ** 2
        + config.velocity * _square(runs.com_velocity[..., :2] / 0.2)
        + config.orientation * (_square(runs.R[..., 2, :2] / 0.1) + 0.5 * _square(runs.rate))
        + config.capture * _square(capture / 0.05)
        + config.feet * (misplaced / 0.05) ** 2
        + config.effort * _square(runs.torque / torque) / torque.size
        + config.posture * _square((runs.q - stance.posture) / 0.1) / torque.size
    )
    return total.mean(axis=-1)


def _square(residual: Array) -> Array:
    return np.einsum("...i,...i->...", residual, residual)
