"""The compiled feet of an estimator, one sample at a time."""

from __future__ import annotations

from golem.hardware.estimator.feet import FEET, FeetConfig, put_feet, sense_feet
from golem.native import new_record
from golem.robots.model.spatial import skew
from golem.types import Array, LowState


class Feet:
    """Both feet of one robot, axes of base_link.

    The point of a foot that stands still is where it presses on the ground: heel and toe of a foot that rolls do not.
    """

    def __init__(self, config: FeetConfig) -> None:
        """Start with nothing known."""
        memory = new_record(FEET)
        put_feet(memory, config)
        self._memory = memory[0]

    def step(self, state: LowState, up: Array, omega: Array, dt: float) -> None:
        """Take one sample.

        Args:
            state: joints and torques.
            up: (3,) the vertical in base_link.
            omega: (3,) angular rate of base_link, in base_link [rad/s].
            dt: time since the previous sample [s].
        """
        sense_feet(self._memory, state.q, state.dq, state.tau, up, omega, dt)

    @property
    def force(self) -> Array:
        """(2,) vertical force of the ground [N]."""
        return self._memory["force"].copy()

    @property
    def contact(self) -> Array:
        """(2,) probability that each foot carries load."""
        return self._memory["contact"].copy()

    @property
    def weight(self) -> Array:
        """(2,) how far each is to be believed to stand still."""
        return self._memory["weight"].copy()

    @property
    def points(self) -> Array:
        """(2, 3) centre of pressure [m]."""
        return self._memory["points"].copy()

    @property
    def rates(self) -> Array:
        """(2, 3) velocity of the sole there, relative to base_link [m/s]."""
        return self._memory["rates"].copy()

    @property
    def local(self) -> Array:
        """(2, 3) centre of pressure from the middle of the sole, axes of the foot [m]."""
        return self._memory["local"].copy()


def base_velocity(R: Array, omega: Array, soles: Array, rates: Array) -> Array:
    """Return the (..., 2, 3) velocity of base_link that each foot implies if it stands still [m/s], world axes.

        z_k = -R_b [omega_b x p_k + J_k dq]

    which is the paper's eq. (legodom) with omega in base_link, where p_k and J_k dq are known.

    Args:
        R: (..., 3, 3) rotation of base_link in the world-fixed frame.
        omega: (..., 3) angular rate of base_link, in base_link [rad/s].
        soles: (..., 2, 3) points of the left and the right foot, in base_link [m].
        rates: (..., 2, 3) their velocities relative to base_link, in base_link: J_k dq [m/s].
    """
    turning = soles @ skew(omega).swapaxes(-1, -2)
    return -(turning + rates) @ R.swapaxes(-1, -2)
