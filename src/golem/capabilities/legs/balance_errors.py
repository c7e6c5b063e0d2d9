"""How well a robot stands: capture point and feet against where they belong, for one robot or for many at once.

Makes up for what a leg controller falls short of: an integral of the velocity error, added to its twist.

Learned policies under-track by a tenth or so, each in its own way, and drift sideways a little. The base estimate knows
the velocity far better than that, so the base layer corrects it once for all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.kernels import njit
from golem.native import Record, new_record
from golem.types import GRAVITY, Array


def heading_frame(R: Array) -> Array:
    """Return the (..., 2, 2) rotation from the heading frame of `R` (..., 3, 3) into its parent frame, about z."""
    norm = np.hypot(R[..., 0, 0], R[..., 1, 0])
    c, s = R[..., 0, 0] / norm, R[..., 1, 0] / norm
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


@njit(cache=True, nogil=True)
def heading(R: Array) -> tuple[float, float]:
    """Return cosine and sine of the heading of `R` (3, 3)."""
    norm = math.hypot(R[0, 0], R[1, 0])
    return R[0, 0] / norm, R[1, 0] / norm


@njit(cache=True, nogil=True)
def stand_errors(R: Array, com: Array, velocity: Array, soles: Array, stance: Array, out: Array) -> None:
    """Write what `balance_errors` returns of one robot into `out` (3,): capture point, misplacement."""
    lead = math.sqrt(max(com[2] - min(soles[0, 2], soles[1, 2]), 0.1) / GRAVITY)
    x = com[0] + velocity[0] * lead - (soles[0, 0] + soles[1, 0]) / 2.0
    y = com[1] + velocity[1] * lead - (soles[0, 1] + soles[1, 1]) / 2.0
    c, s = heading(R)
    out[0], out[1] = c * x + s * y, c * y - s * x
    x, y = soles[0, 0] - soles[1, 0], soles[0, 1] - soles[1, 1]
    ahead, sideways = c * x + s * y - stance[0], c * y - s * x - stance[1]
    out[2] = math.sqrt(ahead * ahead + sideways * sideways)


@njit(cache=True, nogil=True)
def _all_errors(R: Array, com: Array, velocity: Array, soles: Array, stance: Array, out: Array) -> None:
    for i in range(len(com)):
        stand_errors(R[i], com[i], velocity[i], soles[i], stance, out[i])


def balance_errors(R: Array, com: Array, velocity: Array, soles: Array, stance: Array) -> tuple[Array, Array]:
    """Return the capture point relative to the middle of the feet (..., 2) and the feet's misplacement (...) [m].

    The capture point is x + v sqrt(h/g) with the CoM's position x, velocity v and height h above the soles.

    Args:
        R: (..., 3, 3) rotation of base_link in a level frame.
        com: (..., 3) centre of mass in that level frame, from any origin [m].
        velocity: (..., 3) its velocity [m/s].
        soles: (..., 2, 3) centres of the left and the right sole, same frame and origin [m].
        stance: (2,) where the left sole belongs relative to the right one, x ahead, y left [m].
    """
    out = np.empty(com.shape)
    R, com, velocity, soles, stance = map(np.ascontiguousarray, (R, com, velocity, soles, stance))
    coms, velocities = com.reshape(-1, 3), velocity.reshape(-1, 3)
    _all_errors(R.reshape(-1, 3, 3), coms, velocities, soles.reshape(-1, 2, 3), stance, out.reshape(-1, 3))
    return out[..., :2], out[..., 2]


@dataclass(frozen=True, slots=True)
class VelocityIntegratorConfig:
    """Options of `VelocityIntegrator`.

    Attributes:
        gain: correction per velocity error and time [1/s].
        maximum: bound of the correction of vx, vy [m/s] and wz [rad/s]; by so much the twist may leave the envelope.
            Turning falls short most, where it is asked for beside full speed ahead and to a side.
        heed: bound of each error that is integrated: a push is not the controller's doing.
        smoothing: time constant of the filter on command and measurement [s]: a period of the gait, whose sway shall
            not reach the twist.
    """

    gain: float = 0.8
    maximum: tuple[float, float, float] = (0.15, 0.15, 0.4)
    heed: tuple[float, float, float] = (0.15, 0.15, 0.15)
    smoothing: float = 0.7


TRIM = np.dtype(
    [
        *(("gain", "f8"), ("smoothing", "f8"), ("maximum", "f8", (3,)), ("heed", "f8", (3,))),
        *(("surplus", "f8", (3,)), ("correction", "f8", (3,))),
    ]
)
"""Options, then what was learned: the filtered velocity error and its integral."""


@njit(cache=True, nogil=True)
def step_trim(m: Record, twist: Array, R: Array, velocity: Array, turn: float, dt: float, out: Array) -> None:
    """Write into `out` (3,) the twist to command so that `twist` is what comes of it; `m` is a `TRIM`.

    Args:
        twist: (3,) vx, vy [m/s], wz [rad/s] that is wanted.
        R: (3, 3) rotation of base_link in a level frame.
        velocity: (3,) of base_link in that frame [m/s].
        turn: its angular rate about the vertical [rad/s].
        dt: time since the previous step [s].
    """
    c, s = heading(R)
    share = dt / (m.smoothing + dt)
    for a in range(3):
        if a == 0:
            measured = c * velocity[0] + s * velocity[1]
        else:
            measured = c * velocity[1] - s * velocity[0] if a == 1 else turn
        # Command and measurement pass the same filter, so that its lag is no error.
        m.surplus[a] += (twist[a] - measured - m.surplus[a]) * share
        change = m.gain * dt * min(max(m.surplus[a], -m.heed[a]), m.heed[a])
        m.correction[a] = min(max(m.correction[a] + change, -m.maximum[a]), m.maximum[a])
        out[a] = twist[a] + m.correction[a]


class VelocityIntegrator:
    """The correction of one robot's twist; `memory` is (1,) of `TRIM`."""

    def __init__(self, config: VelocityIntegratorConfig | None = None) -> None:
        self.config = c = config or VelocityIntegratorConfig()
        self.memory = new_record(TRIM)
        for name in ("gain", "smoothing", "maximum", "heed"):
            self.memory[name] = getattr(c, name)

    def reset(self) -> None:
        """Forget what was learned: the robot stands, or another controller took over."""
        self.memory["surplus"] = self.memory["correction"] = 0.0
