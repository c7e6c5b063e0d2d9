"""What one robot's feet tell an estimator: where they press on the ground, how they move, whether they carry it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from golem.hardware.estimator import feet_kernel
from golem.hardware.estimator.contact import Contact, ContactConfig
from golem.hardware.estimator.foot_force import FootForce, FootForceConfig
from golem.robots.model.leg_dynamics import LegDynamics
from golem.robots.model.table import SOLE
from golem.types import GRAVITY, LEGS, Array, LowState

_HALF: Array = 0.5 * np.array([SOLE.x[1] - SOLE.x[0], SOLE.y[1] - SOLE.y[0]])
"""(2,) half length and half width of a sole [m]."""
_THICKNESS = 0.01
"""Height above the other foot from which one may stand on it [m]: half of what it takes. What a foot carries that
stands on the other one goes to that one, which it pins to the ground: pushed to a side, a robot that walks may cross
its legs, and the leg of the lower foot then feels no load."""


@dataclass(frozen=True, slots=True)
class FeetConfig:
    """Options of `Feet`.

    Attributes:
        force: how forces come from torques.
        contact: how contacts come from forces.
        min_force: force above which the centre of pressure is computed [N]; below, it is the middle of the sole.
        turning: angular rate of a foot at which it is believed half as much [rad/s]. A foot that rolls over its edge
            turns about a line that is not known well: 3 cm of doubt at this rate are the noise of a planted foot.
        sliding: speed of the feet relative to each other at which the less loaded one is believed half as much [m/s].
            One of them moves, and a foot that is dragged may well carry 150 N.
    """

    force: FootForceConfig = field(default_factory=FootForceConfig)
    contact: ContactConfig = field(default_factory=ContactConfig)
    min_force: float = 50.0
    turning: float = 1.67
    sliding: float = 0.1


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
        self._legs = LegDynamics()
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
        self.rotations = legs.rotations
        self.force = feet_kernel.loads(wrench, up, legs.soles, legs.rotations, _HALF, _THICKNESS)
        self.contact, self.weight = self._contact.step(self.force, dt)
        numbers = np.array([config.min_force, config.turning, config.sliding])
        self.local, self.points, self.rates = feet_kernel.pressed(
            wrench,
            self.force,
            self.weight,
            omega,
            legs.soles,
            legs.rotations,
            legs.twists,
            _HALF,
            numbers,
        )


class LevelFloor:
    """The height of base_link, above the feet that carry it and in odom, on a floor taken as level.

    In odom it is the integral of the velocity, held to the planted feet: soles that give way under load, and every
    footstep, would otherwise let it sink without end.
    """

    LAG = 0.1
    """Time constant with which the height in odom follows the planted feet [s]."""

    def __init__(self) -> None:
        """Start at the height of odom's origin, above a floor not seen yet."""
        self.reset()

    def reset(self) -> None:
        """Start over."""
        self._z = 0.0
        self._floor: float | None = None

    @property
    def seen(self) -> bool:
        """Whether a foot has carried the robot since the reset; before, nothing measured its velocity either."""
        return self._floor is not None

    def step(self, velocity: float, up: Array, feet: Feet, dt: float) -> tuple[float, float]:
        """Return the height above the feet that carry the robot, 0 where none does, and z of base_link in odom [m].

        Args:
            velocity: vertical velocity of base_link [m/s].
            up: (3,) the vertical in base_link.
            feet: at the present sample.
            dt: time since the previous one [s].
        """
        # Squares: a foot that is being unloaded soon counts little.
        share = feet.weight * feet.weight
        total = float(share[0] + share[1])
        self._z += velocity * dt
        if total == 0.0:
            return 0.0, self._z
        height = -float(share @ (feet.points @ up)) / total
        if self._floor is None:
            self._floor = self._z - height
        self._z += dt / (self.LAG + dt) * (self._floor + height - self._z)
        return height, self._z
