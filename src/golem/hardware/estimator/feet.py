"""What one robot's feet tell an estimator: where they press on the ground, how they move, whether they carry it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from golem.hardware.estimator.contact import Contact, ContactConfig
from golem.hardware.estimator.foot_force import FootForce, FootForceConfig
from golem.robots.model.legs import Legs
from golem.robots.model.table import SOLE
from golem.types import LEGS, Array, LowState

GRAVITY = 9.81
"""[m/s^2], as in the twin."""
_HALF_LENGTH = 0.5 * (SOLE.x[1] - SOLE.x[0])
_HALF_WIDTH = 0.5 * (SOLE.y[1] - SOLE.y[0])


@dataclass(frozen=True, slots=True)
class FeetConfig:
    """Options of `Feet`.

    Attributes:
        force: how forces come from torques.
        contact: how contacts come from forces.
        least_force: force above which the centre of pressure is computed [N]; below, it is the middle of the sole.
        turning: angular rate of a foot at which it is believed half as much [rad/s]. A foot that rolls over its edge
            turns about a line that is not known well: 3 cm of doubt at this rate are the noise of a planted foot.
    """

    force: FootForceConfig = field(default_factory=FootForceConfig)
    contact: ContactConfig = field(default_factory=ContactConfig)
    least_force: float = 50.0
    turning: float = 1.67


class Feet:
    """Both feet of one robot, axes of base_link.

    The point of a foot that stands still is where it presses on the ground: heel and toe of a foot that rolls do not.

    Attributes:
        force: (2,) vertical force of the ground [N].
        contact: (2,) probability that each foot carries load.
        weight: (2,) how far each is to be believed to stand still.
        points: (2, 3) centre of pressure [m].
        rates: (2, 3) velocity of the sole there, relative to base_link [m/s].
        rotations: (2, 3, 3) of the soles.
        local: (2, 3) centre of pressure from the middle of the sole, axes of the foot [m].
    """

    def __init__(self, config: FeetConfig) -> None:
        """Start with nothing known."""
        self.config = config
        self._legs = Legs()
        self._force, self._contact = FootForce(config.force), Contact(config.contact)
        self.force: Array = np.zeros(2)
        self.contact: Array = np.zeros(2)
        self.weight: Array = np.zeros(2)
        self.points: Array = np.zeros((2, 3))
        self.rates: Array = np.zeros((2, 3))
        self.rotations: Array = np.zeros((2, 3, 3))
        self.local: Array = np.zeros((2, 3))

    def reset(self) -> None:
        """Forget; feet that the next sample finds loaded have stood long."""
        self._force.reset()
        self._contact.reset()

    def step(self, state: LowState, up: Array, omega: Array, dt: float) -> None:
        """Take one sample.

        Args:
            state: joints and torques.
            up: (3,) the vertical in base_link.
            omega: (3,) angular rate of base_link, in base_link [rad/s].
            dt: time since the previous sample [s].
        """
        legs, config = self._legs, self.config
        legs.update(state.q[LEGS], state.dq[LEGS])
        wrench = self._force.step(legs, state, -GRAVITY * up, dt)
        self.force = wrench[:, :3] @ up
        self.contact, weight = self._contact.step(self.force, dt)
        turn = legs.twists[:, 3:]
        rate = (turn + omega) / config.turning
        self.weight = weight / (1.0 + (rate * rate).sum(axis=1))

        # Force and moment in the axes of the foot; a row times a rotation is its transpose times the column.
        (force_l, moment_l), (force_r, moment_r) = (wrench.reshape(2, 2, 3) @ legs.rotations).tolist()
        self.local = np.array([self._pressure(force_l, moment_l), self._pressure(force_r, moment_r)])
        self.rotations = legs.rotations
        lever = (legs.rotations @ self.local[..., None])[..., 0]
        self.points = legs.soles + lever
        self.rates = legs.twists[:, :3] + turn[:, _YZX] * lever[:, _ZXY] - turn[:, _ZXY] * lever[:, _YZX]

    def _pressure(self, force: list[float], moment: list[float]) -> tuple[float, float, float]:
        normal = force[2]
        if normal < self.config.least_force:
            return 0.0, 0.0, 0.0
        x, y = -moment[1] / normal, moment[0] / normal
        return (
            min(max(x, -_HALF_LENGTH), _HALF_LENGTH),
            min(max(y, -_HALF_WIDTH), _HALF_WIDTH),
            0.0,
        )


_YZX, _ZXY = [1, 2, 0], [2, 0, 1]


def height_above(up: Array, points: Array, weight: Array) -> float:
    """Return the height of base_link above the feet that carry it [m]; 0 where none does.

    Args:
        up: (3,) the vertical in base_link.
        points: (2, 3) where the feet press on the ground, in base_link [m].
        weight: (2,) how far each foot is to be believed; its square counts, so that one that is unloaded soon does not.
    """
    share = weight * weight
    total = float(share[0] + share[1])
    return 0.0 if total == 0.0 else -float(share @ (points @ up)) / total
