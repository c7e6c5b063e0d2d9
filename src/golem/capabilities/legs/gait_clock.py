"""What the base layer does with the measured robot: how well it stands, when it steps, where it rests, how it drifts.

One compiled step for one robot at up to 100 Hz, over the records of `Gait`, `StopPredictor` and `VelocityIntegrator`.

Where a robot that steps would come to rest: above its footprints, as it stood before it set off.

A body that walks or marks time sways over its feet and leans otherwise than one that stands; the feet stay where they
are when it stops. So a navigator that looks at the body stops it beside the goal, by 3 cm and some degrees.
"""

from __future__ import annotations

import math

import numpy as np

from golem.capabilities.legs.balance_errors import TRIM, VelocityIntegrator, stand_errors, step_trim
from golem.capabilities.legs.gait import GAIT, GAIT_OPTIONS, Gait, step_gait
from golem.hardware.servo.gravity import body_tree
from golem.kernels import njit
from golem.native import Record, address, new_record, view
from golem.robots.model.imu_mount import TORSO, turn_to_base
from golem.robots.model.leg_kernel import LEG, SOLE, tree_dtype, tree_frames
from golem.robots.model.table import BASE_LINK, LINKS
from golem.types import LEGS, NUM_JOINTS, Array, BaseEstimate, LowState, PlanarPose, Twist

SMOOTHING = 0.7
"""Time constant of the filter on what is predicted [s]: a period of the gait."""
STOOD = 0.5
"""Time without a step after which the robot stands as it does [s]."""
LOADED = 0.5
"""Probability of contact from which a foot counts as planted."""

TAU = math.tau
REST = np.dtype(
    [
        *(("pose", "f8", (3,)), ("prints", "f8", (2, 3)), ("samples", "i8", (2,))),
        *(("stance", "f8", (3,)), ("known", "?"), ("stood", "f8")),
    ]
)
"""Planar poses, x, y, yaw each: the place of rest in base_link, footprints and how many samples each is the mean of,
base_link above the middle of the footprints once it is `known`; time without a step [s]."""


@njit(cache=True, nogil=True)
def planar(T: Array, out: Array) -> None:
    """Write what `PlanarPose.of` returns of `T` (4, 4) into `out` (3,)."""
    out[0], out[1], out[2] = T[0, 3], T[1, 3], math.atan2(T[1, 0], T[0, 0])


@njit(cache=True, nogil=True)
def _wrap(angle: float) -> float:
    return angle - TAU * round(angle / TAU)


@njit(cache=True, nogil=True)
def _to(a: Array, b: Array, out: Array) -> None:
    """Write what `PlanarPose.to` returns for (3,) poses into `out`."""
    c, s = math.cos(a[2]), math.sin(a[2])
    x, y = b[0] - a[0], b[1] - a[1]
    out[0], out[1], out[2] = c * x + s * y, c * y - s * x, _wrap(b[2] - a[2])


@njit(cache=True, nogil=True)
def _after(a: Array, b: Array, share: float, out: Array) -> None:
    """Write the pose `a` @ (`share` * `b`) into `out`; see `PlanarPose`."""
    c, s = math.cos(a[2]), math.sin(a[2])
    x, y = share * b[0], share * b[1]
    out[0], out[1], out[2] = a[0] + c * x - s * y, a[1] + s * x + c * y, _wrap(a[2] + share * b[2])


@njit(cache=True, nogil=True)
def _toward(a: Array, b: Array, share: float, out: Array) -> None:
    """Write what `PlanarPose.toward` returns into `out`, which may be `a`."""
    step = np.empty(3)
    _to(a, b, step)
    _after(a, step, share, out)


@njit(cache=True, nogil=True)
def step_rest(m: Record, here: Array, feet: Array, contact: Array, moving: bool, dt: float) -> None:
    """Advance `m`, a `REST`, by `dt` [s].

    Args:
        here: (3,) planar pose of base_link in odom.
        feet: (2, 3) those of the soles, left and right.
        contact: (2,) probability that each foot carries load.
        moving: whether the robot walks or steps.
    """
    for k in range(2):
        planted = not moving or contact[k] > LOADED
        # The mean over a stance, because a sole rolls and the estimate trembles; at rest the newest is the best.
        m.samples[k] = m.samples[k] + 1 if planted and moving else int(planted)
        if planted:
            _toward(m.prints[k], feet[k], 1.0 / m.samples[k], m.prints[k])
    middle, expected, step = np.empty(3), np.empty(3), np.empty(3)
    _toward(m.prints[0], m.prints[1], 0.5, middle)
    if not moving:
        m.pose[0] = m.pose[1] = m.pose[2] = 0.0
        m.stood += dt
        if m.stood > STOOD:
            m.known = True
            _to(middle, here, m.stance)
        return
    m.stood = 0.0
    if m.known:
        _after(middle, m.stance, 1.0, step)
        _to(here, step, expected)
        _toward(m.pose, expected, dt / (SMOOTHING + dt), m.pose)


class StopPredictor:
    """Remembers the footprints of one robot, and how it stands above them; `memory` is (1,) of `REST`."""

    def __init__(self) -> None:
        """Begin without footprints: the robot is taken to stay where it is."""
        self.memory = new_record(REST)
        self._pose: Array = self.memory["pose"][0]

    @property
    def pose(self) -> PlanarPose:
        """The place of rest as seen from base_link."""
        return PlanarPose(*self._pose.tolist())

    def reset(self) -> None:
        """Forget everything."""
        self.memory[:] = np.zeros((), REST)


SEEN = np.dtype(
    [
        *(("q", "f8", (NUM_JOINTS,)), ("waist_rate", "f8"), ("gyro", "f8", (3,))),
        *(("base", "f8", (4, 4)), ("velocity", "f8", (3,)), ("contact", "f8", (2,))),
        *(("twist", "f8", (3,)), ("trims", "?"), ("out", "f8", (3,)), ("stance", "f8", (2,))),
    ]
)
"""What the clock reads: the measured robot, the twist to apply and whether it is to be corrected, where the left sole
belongs relative to the right one; and what it writes, `out`, the corrected twist."""
_seen_at, _gait_at, _options_at = view(SEEN), view(GAIT), view(GAIT_OPTIONS)
_rest_at, _trim_at, _tree_at = view(REST), view(TRIM), view(tree_dtype(NUM_JOINTS))
_BASE_MASS, _BASE_COM = LINKS[BASE_LINK].mass, tuple(LINKS[BASE_LINK].com.tolist())
_ANKLES = (LEG - 1, LEGS.stop - 1)


@njit(cache=True, nogil=True)
def soles_and_com(tree: int, q: Array, soles: Array, rotations: Array, com: Array) -> None:
    """Write where the soles and the centre of mass of the whole robot, hands empty, are in base_link.

    Args:
        tree: address of the tree of all joints; see `leg_kernel`.
        q: (27,) joint positions [rad].
        soles: (2, 3) their centres [m]; is filled, like the following.
        rotations: (2, 3, 3) of the ankle_roll links.
        com: (3,) centre of mass [m].
    """
    t = _tree_at(tree)
    n = len(t.mass)
    R, p = np.empty((n, 3, 3)), np.empty((n, 3))
    tree_frames(t, q, R, p)
    mass = _BASE_MASS
    for a in range(3):
        com[a] = _BASE_MASS * _BASE_COM[a]
    for i in range(n):
        mass += t.mass[i]
        for a in range(3):
            at = p[i, a]
            for c in range(3):
                at += R[i, a, c] * t.com[i, c]
            com[a] += t.mass[i] * at
    for a in range(3):
        com[a] /= mass
        for k in range(2):
            i = _ANKLES[k]
            soles[k, a] = p[i, a]
            for c in range(3):
                soles[k, a] += R[i, a, c] * SOLE[c]
                rotations[k, a, c] = R[i, a, c]


@njit(cache=True, nogil=True)
def _level(R: Array, x: Array, out: Array) -> None:
    for a in range(3):
        out[a] = R[a, 0] * x[0] + R[a, 1] * x[1] + R[a, 2] * x[2]


@njit(cache=True, nogil=True)
def _advance(seen: int, tree: int, gait: int, options: int, rest: int, trim: int, dt: float) -> None:
    """Advance everything by `dt` [s]; the others are addresses of the records above."""
    s, g, o, m = _seen_at(seen), _gait_at(gait), _options_at(options), _trim_at(trim)
    T = s.base
    soles, rotations, level = np.empty((2, 3)), np.empty((2, 3, 3)), np.empty((2, 3))
    com, at, errors = np.empty(3), np.empty(3), np.empty(3)
    rate, spin, velocity = np.empty(3), np.empty(3), np.empty(3)
    soles_and_com(tree, s.q, soles, rotations, com)
    _level(T, com, at)
    turn_to_base(s.gyro, s.q[TORSO], s.waist_rate, rate)
    _level(T, rate, spin)
    velocity[0] = s.velocity[0] + (spin[1] * at[2] - spin[2] * at[1])
    velocity[1] = s.velocity[1] + (spin[2] * at[0] - spin[0] * at[2])
    velocity[2] = s.velocity[2] + (spin[0] * at[1] - spin[1] * at[0])
    for k in range(2):
        _level(T, soles[k], level[k])
    stand_errors(T, at, velocity, level, s.stance, errors)
    commanded = s.twist[0] != 0.0 or s.twist[1] != 0.0 or s.twist[2] != 0.0
    step_gait(g, o, commanded, errors[0], errors[1], errors[2], dt)

    here, feet = np.empty(3), np.empty((2, 3))
    planar(T, here)
    for k in range(2):
        feet[k, 0], feet[k, 1] = level[k, 0] + T[0, 3], level[k, 1] + T[1, 3]
        R = rotations[k]
        x = T[0, 0] * R[0, 0] + T[0, 1] * R[1, 0] + T[0, 2] * R[2, 0]
        y = T[1, 0] * R[0, 0] + T[1, 1] * R[1, 0] + T[1, 2] * R[2, 0]
        feet[k, 2] = math.atan2(y, x)
    step_rest(_rest_at(rest), here, feet, s.contact, commanded or (g.stepping and not o.always), dt)
    for a in range(3):
        s.out[a] = s.twist[a]
    if not (commanded or g.stepping):
        for a in range(3):
            m.surplus[a] = m.correction[a] = 0.0
    elif s.trims:
        # Also through the last steps of a stop, and those after a push: they shall not carry it away.
        step_trim(m, s.twist, T, s.velocity, spin[2], dt, s.out)


class GaitClock:
    """Runs gait, stop predictor and, if there is one, trim of one robot on one measurement."""

    def __init__(self, gait: Gait, rest: StopPredictor, trim: VelocityIntegrator | None) -> None:
        tree, self._records = body_tree(), new_record(SEEN)
        self._seen = seen = self._records[0]
        learned = VelocityIntegrator() if trim is None else trim
        self._kept = (gait, rest, learned)
        records = (self._records, tree, gait.memory, gait.options, rest.memory, learned.memory)
        self._places = [address(record) for record in records]
        self._out: Array = self._records["out"][0]
        seen["trims"] = trim is not None
        soles, com = np.empty((2, 3)), np.empty(3)
        soles_and_com(self._places[1], np.zeros(NUM_JOINTS), soles, np.empty((2, 3, 3)), com)
        # With both hips straight and level the distance of the feet does not depend on how far the knees are bent.
        seen["stance"] = (soles[0] - soles[1])[:2]

    def step(self, state: LowState, base: BaseEstimate, twist: Twist, dt: float) -> Array:
        """Advance by `dt` [s]; return what to command so that the robot moves at `twist`: (3,), vx, vy, wz."""
        seen = self._seen
        seen["q"], seen["waist_rate"], seen["gyro"] = state.q, state.dq[TORSO], state.imu.gyro
        seen["base"], seen["velocity"], seen["contact"] = base.T_odom_base, base.velocity, base.contact
        seen["twist"] = twist.vx, twist.vy, twist.wz
        records, tree, gait, options, rest, trim = self._places
        _advance(records, tree, gait, options, rest, trim, dt)
        return self._out
