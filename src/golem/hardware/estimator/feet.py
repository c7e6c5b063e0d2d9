"""What one robot's feet tell an estimator: where they press on the ground, how they move, whether they carry it.

The wrench of the ground on each foot, from the torques of the leg's six joints.

With base_link as the frame of reference and h(q) the weight of the leg, tau + J^T w = d(M dq)/dt + h(q): the joints
feel the ground's wrench w through the transposed Jacobian of the sole, six equations for six unknowns. What is left
out is the Coriolis term and the acceleration of base_link.

A leg that swings feels its own inertia (mostly the motors' armature) as a force of several hundred newtons, so
d(M dq)/dt is not left out: both sides pass the same low-pass, whose response to a derivative needs no acceleration
measured (the momentum observer of De Luca et al., IROS 2006).
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, field

import numpy as np
from numpy.typing import NDArray

from golem.hardware.estimator import feet_kernel
from golem.hardware.estimator.feet_kernel import contact, loads, press, wrenches
from golem.kernels import njit
from golem.native import Record, Records
from golem.robots.model.leg_kernel import LEG, LEG_MOTION, leg_motion, leg_tree, tree_dtype
from golem.robots.model.table import SOLE
from golem.types import GRAVITY, LEGS, Array


@dataclass(frozen=True, slots=True)
class ContactConfig:
    """When a foot counts as planted.

    Attributes:
        touch, leave: force above which a lifted foot has touched down, and below which it has left the ground [N].
        middle, width: force of probability one half, and of the sigmoid's scale [N].
        settle: time after touch-down for which a foot is not believed to stand still: it lands, slides and rolls [s].
        ramp: time over which it is then believed more and more [s].
    """

    touch: float = 120.0
    leave: float = 60.0
    middle: float = 150.0
    width: float = 35.0
    settle: float = 0.03
    ramp: float = 0.02


class Contact:
    """The contact state of both feet of `shape` robots.

    Attributes:
        config: thresholds and times.
        planted: (*shape, 2) whether the foot is on the ground.
        age: (*shape, 2) time since it touched down [s].
    """

    def __init__(self, config: ContactConfig, shape: tuple[int, ...] = ()) -> None:
        self.config = config
        self.planted: NDArray[np.bool_] = np.zeros((*shape, 2), dtype=bool)
        self.age: Array = np.zeros((*shape, 2))
        self._new: NDArray[np.bool_] = np.ones(shape, dtype=bool)
        self._numbers: Array = np.array(astuple(config))

    def reset(self, where: NDArray[np.bool_] | None = None) -> None:
        """Forget the robots `where` (*shape,); None is all.

        The first force after a reset is taken as it is, and a foot that it finds loaded as planted long ago.
        """
        self._new = np.ones_like(self._new) if where is None else self._new | where

    def step(self, force: Array, dt: float) -> tuple[Array, Array]:
        """Take the next forces.

        Args:
            force: (*shape, 2) vertical force of the ground on each foot [N].
            dt: time since the previous ones [s].

        Returns:
            probability (*shape, 2) that the foot carries load, and weight (*shape, 2): how far it is to be believed
            to stand still; zero for a while after touch-down, then the probability.
        """
        rows = force.reshape(-1, 2)
        probability, weight = feet_kernel.contacts(
            rows, self.planted.reshape(-1, 2), self.age.reshape(-1, 2), self._new.reshape(-1), self._numbers, dt
        )
        return probability.reshape(force.shape), weight.reshape(force.shape)


@dataclass(frozen=True, slots=True)
class FootForceConfig:
    """Options of `foot_wrenches`.

    Attributes:
        lag: time constant of the low-pass [s].
        damping: lever arm below which a force is not resolved [m]: the stretched knee passes the weight on without
            any torque, and noise over zero is no force.
        foot: lever arm at which a moment on the sole weighs as much as a force [m].
    """

    lag: float = 0.005
    damping: float = 0.01
    foot: float = 0.1

    def floor(self) -> Array:
        """Return the (6,) squared damping of forces and moments."""
        return np.repeat([self.damping, self.damping / self.foot], 3) ** 2


FOOT_FORCE = np.dtype(
    [("lag", "f8"), ("floor", "f8", (6,)), ("torque", "f8", (2, LEG)), ("momentum", "f8", (2, LEG)), ("begun", "i8")]
)
"""Options and memory of `foot_wrenches`; not `begun`, the next sample is taken as if nothing had moved before."""


@njit(cache=True, nogil=True)
def foot_wrenches(m: Record, motion: Record, tau: Array, dt: float) -> Array:
    """Return the (2, 6) wrench on the left and the right foot: force [N], moment about the sole's centre [N m].

    Args:
        m: a `FOOT_FORCE`.
        motion: of the legs at this sample, a `LEG_MOTION`; the wrench has its axes, those of base_link.
        tau: of all motors [N m]; the legs are the first twelve.
        dt: time since the previous sample [s].
    """
    share, external = dt / (m.lag + dt), np.empty((2, LEG))
    for k in range(2):
        for i in range(LEG):
            torque, momentum = motion.gravity[k, i] - tau[LEG * k + i], motion.momentum[k, i]
            if not m.begun:
                m.torque[k, i], m.momentum[k, i] = torque, momentum
            m.torque[k, i] += share * (torque - m.torque[k, i])
            m.momentum[k, i] += share * (momentum - m.momentum[k, i])
            external[k, i] = m.torque[k, i] + (momentum - m.momentum[k, i]) / m.lag
    m.begun = 1
    # Least squares, damped: J J^T w = J tau.
    return wrenches(motion.jacobians, external, m.floor)


_HALF: Array = 0.5 * np.array([SOLE.x[1] - SOLE.x[0], SOLE.y[1] - SOLE.y[0]])
"""(2,) half length and half width of a sole [m]."""


@dataclass(frozen=True, slots=True)
class FeetConfig:
    """Options of `sense_feet`.

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


FEET = np.dtype(
    [
        ("tree", tree_dtype(LEGS.stop)),
        ("motion", LEG_MOTION),
        ("wrench", FOOT_FORCE),
        ("half", "f8", (2,)),
        ("contacts", "f8", (6,)),
        ("doubts", "f8", (3,)),
        ("planted", "i8", (2,)),
        ("age", "f8", (2,)),
        ("new", "i8"),
        *((name, "f8", (2,)) for name in ("force", "contact", "weight")),
        *((name, "f8", (2, 3)) for name in ("points", "rates", "local")),
    ]
)
"""Options, memory and answers of `sense_feet`, in the axes of base_link.

Of each foot: `force`, the vertical force of the ground [N]; `contact`, the probability that it carries load; `weight`,
how far it is to be believed to stand still; `points`, where it presses on the ground [m]: heel and toe of a foot that
rolls do not; `rates`, the velocity of the sole there relative to base_link [m/s]; `local`, that place from the middle
of the sole, in the axes of the foot [m].
"""


def put_feet(memory: Records, config: FeetConfig, tree: Records | None = None) -> None:
    """Write the robot's legs and the options `config` into `memory`, a `FEET`; `tree` replaces Pinocchio's legs."""
    memory["tree"] = leg_tree() if tree is None else tree
    memory["wrench"]["lag"], memory["wrench"]["floor"] = config.force.lag, config.force.floor()
    memory["half"] = _HALF
    memory["contacts"] = astuple(config.contact)
    memory["doubts"] = config.min_force, config.turning, config.sliding
    forget_feet(memory)


def forget_feet(memory: Records) -> None:
    """Start over: feet that the next sample finds loaded have stood long."""
    memory["wrench"]["begun"], memory["new"] = 0, 1


@njit(cache=True, nogil=True)
def sense_feet(m: Record, q: Array, dq: Array, tau: Array, up: Array, omega: Array, dt: float) -> None:
    """Take one sample into `m`, a `FEET`.

    Args:
        m: of one robot.
        q: joints [rad].
        dq: their velocities [rad/s].
        tau: their torques [N m].
        up: (3,) the vertical in base_link.
        omega: (3,) angular rate of base_link, in base_link [rad/s].
        dt: time since the previous sample [s].
    """
    gravity = np.empty(3)
    for a in range(3):
        gravity[a] = -GRAVITY * up[a]
    legs = m.motion
    leg_motion(m.tree, q, dq, gravity, legs)
    wrench = foot_wrenches(m.wrench, legs, tau, dt)
    loads(m, wrench, up)
    contact(m.force, m.planted, m.age, m.new != 0, m.contacts, dt, m.contact, m.weight)
    m.new = 0
    press(m, wrench, omega)


FLOOR = np.dtype([("z", "f8"), ("floor", "f8"), ("seen", "i8")])
"""Memory of `level_floor`: z of base_link in odom, and of the floor [m]; whether a foot has carried the robot, before
which nothing measured its velocity either."""
LAG = 0.1
"""Time constant with which the height in odom follows the planted feet [s]."""


@njit(cache=True, nogil=True)
def level_floor(m: Record, velocity: float, up: Array, feet: Record, dt: float) -> float:
    """Return the height of base_link above the feet that carry it [m], 0 where none does, on a floor taken as level.

    In odom, `m.z`, it is the integral of the velocity, held to the planted feet: soles that give way under load, and
    every footstep, would otherwise let it sink without end.

    Args:
        m: a `FLOOR`.
        velocity: vertical velocity of base_link [m/s].
        up: (3,) the vertical in base_link.
        feet: at the present sample, a `FEET`.
        dt: time since the previous one [s].
    """
    total = height = 0.0
    for k in range(2):
        # Squares: a foot that is being unloaded soon counts little.
        share = feet.weight[k] * feet.weight[k]
        total += share
        height -= share * (feet.points[k, 0] * up[0] + feet.points[k, 1] * up[1] + feet.points[k, 2] * up[2])
    m.z += velocity * dt
    if total == 0.0:
        return 0.0
    height /= total
    if not m.seen:
        m.seen, m.floor = 1, m.z - height
    m.z += dt / (LAG + dt) * (m.floor + height - m.z)
    return height
