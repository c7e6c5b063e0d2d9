"""The gate's own estimate of balance: who carries the robot, where it would come to rest, what its feet say of up.

The capture point x + v / sqrt(g / h) of the centre of mass (Pratt et al., Capture Point, 2006) says where a foot has to
be for the robot to come to rest. Both soles span what it has; where the point leaves that by far, or the robot sinks,
whoever has the legs does not balance it. Compiled, at the looks of `senses`, which need no stack.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from golem.hardware.estimator.attitude import base_rotation
from golem.hardware.estimator.feet import FEET, FeetConfig, forget_feet, put_feet, sense_feet
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces.payloads import Fault, Reason
from golem.kernels import njit
from golem.native import Record, Records, address, new_record, view
from golem.robots.model.imu_mount import TORSO, turn_to_base
from golem.robots.model.leg_kernel import table_tree, tree_dtype, tree_frames
from golem.robots.model.table import BASE_LINK, LINKS
from golem.types import GRAVITY, LEGS, NUM_JOINTS, Array, LowState

BALANCE = np.dtype(
    [
        ("feet", FEET),
        ("tree", tree_dtype(NUM_JOINTS)),
        ("pelvis", "f8", (4,)),
        ("most", "f8", (4,)),
        ("step", "f8"),
        ("new", "i8"),
        ("com", "f8", (3,)),
        ("velocity", "f8", (3,)),
        ("stepped", "f8"),
        ("outside", "f8"),
        ("sinks", "f8"),
        ("leans", "f8"),
        ("low", "f8"),
        ("lasted", "f8", (4,)),
        ("airborne", "f8"),
    ]
)
"""Models, limits (`step` is the first of `most` for who has a foot in the air) and memory; then for how long both feet
have carried the robot [s], how far the capture point is outside [m], how fast the robot sinks [m/s], by how much IMU
and feet differ [rad], how far base_link is below `LEG` [m], for how long each has been too much, and for how long no
foot has carried the robot [s]."""
_balance_at = view(BALANCE)
LASTS = (0.03, 0.03, 0.3, 0.03)
"""Time for which each of the four may be too much [s] [own]."""
LEG = 1.04
"""Height of base_link above the soles of straight legs [m]."""
SMOOTH = 0.03
"""Time constant of the velocity of the centre of mass [s] [own]."""
FLAT = 0.08
"""Angle between two soles below which both stand flat on one floor [rad] [own]."""
SUNK = 0.15
"""How far base_link is below `LEG`, where a robot sinks that does not land from a step [m] [own: landing 0.14]."""
LANDING = 0.1
"""Time for which a foot that has come down is still landing [s] [own]."""
AIRBORNE = 0.3
"""Time without a foot that carries, after which nobody stands [s] [own: as `SafetyLimits.base_age`]."""
_RAYS = 24
_DIRECTIONS = np.array([(math.cos(a), math.sin(a)) for a in np.arange(_RAYS) * 2.0 * math.pi / _RAYS])


@cache
def _blank() -> Records:
    m = new_record(BALANCE)
    put_feet(m["feet"], FeetConfig(), table_tree(LEGS.stop))
    m["tree"], pelvis = table_tree(NUM_JOINTS), LINKS[BASE_LINK]
    m["pelvis"] = pelvis.mass, *pelvis.com
    m["new"], m["stepped"], m["airborne"] = 1, math.inf, math.inf
    return m


def no_balance(limits: SafetyLimits | None = None) -> Records:
    """Return the memory that has seen nothing, a `BALANCE`, with `limits`."""
    m = _blank().copy()
    if limits is not None:
        _put(m, limits)
    return m


def _put(m: Records, limits: SafetyLimits) -> None:
    stands, m["step"] = limits.capture
    m["most"] = stands, limits.sinking, limits.lean, LEG - limits.low


def sensed(m: Records, state: LowState, dt: float | None, limits: SafetyLimits) -> Records:
    """Return `m` after the sample `state`, `dt` after the one before; None forgets those before."""
    m = m.copy()
    _put(m, limits)
    if dt is None:
        forget_feet(m["feet"])
        m["new"], m["lasted"] = 1, 0.0
    imu = state.imu
    numbers = np.concatenate((state.q, state.dq, state.tau, imu.quat, imu.gyro), dtype=np.float64)
    _sense_at(address(m), numbers, 0.01 if dt is None else dt)
    return m


def carried(m: Records) -> bool:
    """Return whether a foot has carried the robot of late."""
    return bool(m["airborne"][0] <= AIRBORNE)


def unbalanced(m: Records) -> Fault | None:
    """Return what `m` says against whoever has the legs, or against the IMU."""
    outside, sinks, leans, low = m["lasted"][0]
    if leans >= LASTS[2]:
        return Fault(Reason.IMU_IMPLAUSIBLE, f"it is {m['leans'][0]:.2f} rad off the soles of both feet")
    if outside >= LASTS[0]:
        return Fault(Reason.BALANCE, f"the capture point is {m['outside'][0]:.2f} m outside the soles")
    if sinks >= LASTS[1]:
        return Fault(Reason.BALANCE, f"it sinks at {m['sinks'][0]:.2f} m/s")
    if low >= LASTS[3]:
        return Fault(Reason.BALANCE, f"base_link is {LEG - m['low'][0]:.2f} m above the lower sole")
    return None


@njit(cache=True)
def _sense_at(place: int, numbers: Array, dt: float) -> None:
    """Do `sense_balance` at the address of the memory: to find the type of a record costs more than the sample."""
    n = NUM_JOINTS
    q, dq, tau = numbers[:n], numbers[n : 2 * n], numbers[2 * n : 3 * n]
    sense_balance(_balance_at(place), q, dq, tau, numbers[3 * n : 3 * n + 4], numbers[3 * n + 4 :], dt)


@njit(cache=True)
def balances(m: Record) -> bool:
    """Return whether `unbalanced` has nothing to say."""
    for k, most in enumerate(LASTS):
        if m.lasted[k] >= most:
            return False
    return True


@njit(cache=True)
def sense_balance(m: Record, q: Array, dq: Array, tau: Array, quat: Array, gyro: Array, dt: float) -> None:
    """Take one sample; `m` is a `BALANCE`, `dt` the time since the one before [s]."""
    T, omega, up, com, feet = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3), m.feet
    base_rotation(quat, q[TORSO], 0.0, T)
    for a in range(3):
        up[a] = T[2, a]
    turn_to_base(gyro, q[TORSO], dq[TORSO], omega)
    sense_feet(feet, q, dq, tau, up, omega, dt)

    R, p, mass = np.empty((NUM_JOINTS, 3, 3)), np.empty((NUM_JOINTS, 3)), m.pelvis[0]
    tree_frames(m.tree, q, R, p)
    for a in range(3):
        com[a] = m.pelvis[0] * m.pelvis[1 + a]
    for i in range(NUM_JOINTS):
        mass += m.tree.mass[i]
        for a in range(3):
            at = p[i, a]
            for c in range(3):
                at += R[i, a, c] * m.tree.com[i, c]
            com[a] += m.tree.mass[i] * at
    total = height = base = 0.0  # of the centre of mass, and of base_link, above the lower sole
    v = np.zeros(3)
    for a in range(3):
        com[a] /= mass
    for k in range(2):
        w = feet.weight[k]
        total += w
        x, y, z = feet.points[k, 0] - com[0], feet.points[k, 1] - com[1], feet.points[k, 2] - com[2]
        v[0] -= w * (omega[1] * z - omega[2] * y + feet.rates[k, 0])
        v[1] -= w * (omega[2] * x - omega[0] * z + feet.rates[k, 1])
        v[2] -= w * (omega[0] * y - omega[1] * x + feet.rates[k, 2])
        above = rises = 0.0
        for a in range(3):
            above += (com[a] - feet.motion.soles[k, a]) * up[a]
            rises -= feet.motion.soles[k, a] * up[a]
        height, base = max(height, above), max(base, rises)
    carries = feet.contact[0] > 0.5 or feet.contact[1] > 0.5
    m.airborne = 0.0 if carries else m.airborne + dt
    sinks, share = 0.0, dt / (SMOOTH + dt)
    for a in range(3):
        moved = 0.0 if m.new else (com[a] - m.com[a]) / dt
        if m.new:
            m.velocity[a] = 0.0
        if total > 0.05:
            m.velocity[a] += share * (v[a] / total + moved - m.velocity[a])
        m.com[a] = com[a]
        sinks -= m.velocity[a] * up[a]
    m.new, m.sinks, m.outside, m.leans, m.low = 0, sinks, 0.0, 0.0, LEG - base
    # Feet that slip or turn measure no velocity, and who falls over them goes on as before.
    falls = m.airborne <= AIRBORNE
    if falls:
        m.outside = _outside(m, up, max(height, 0.2))
    # A foot in the air comes down where it catches the robot.
    one = feet.contact[0] < 0.5 or feet.contact[1] < 0.5
    m.stepped = 0.0 if one else m.stepped + dt
    if feet.weight[0] > 0.7 and feet.weight[1] > 0.7:
        m.leans = _leans(feet.motion.rotations, up)
    for k, much in enumerate((m.outside, m.sinks if falls and m.low > SUNK else 0.0, m.leans, m.low if falls else 0.0)):
        most = m.step if k == 0 and m.stepped < LANDING else m.most[k]
        m.lasted[k] = m.lasted[k] + dt if much > most else max(0.0, m.lasted[k] - dt)


@njit(cache=True)
def _outside(m: Record, up: Array, height: float) -> float:
    """Return how far the capture point is outside the hull of both soles on the level [m], at most 0 inside.

    The largest distance along one of `_RAYS` directions; corners of the hull make it too small by under 1 %.
    """
    motion, half, fall = m.feet.motion, m.feet.half, math.sqrt(height / GRAVITY)
    # Two level axes: forward, and to the left.
    size = math.sqrt(max(1e-6, 1.0 - up[0] * up[0]))
    e, f = np.empty(3), np.empty(3)
    for a in range(3):
        e[a] = ((1.0 if a == 0 else 0.0) - up[0] * up[a]) / size
    f[0], f[1], f[2] = up[1] * e[2] - up[2] * e[1], up[2] * e[0] - up[0] * e[2], up[0] * e[1] - up[1] * e[0]
    corners = np.zeros((8, 2))
    x = y = 0.0
    for a in range(3):
        at = m.com[a] + m.velocity[a] * fall
        x, y = x + at * e[a], y + at * f[a]
        for i in range(8):
            k, along, across = i // 4, (1 - 2 * (i % 2)) * half[0], (1 - (i // 2) % 2 * 2) * half[1]
            corner = motion.soles[k, a] + motion.rotations[k, a, 0] * along + motion.rotations[k, a, 1] * across
            corners[i, 0] += corner * e[a]
            corners[i, 1] += corner * f[a]
    worst = 0.0
    for k in range(_RAYS):
        c, s = _DIRECTIONS[k, 0], _DIRECTIONS[k, 1]
        reach = -math.inf
        for i in range(8):
            reach = max(reach, c * corners[i, 0] + s * corners[i, 1])
        worst = max(worst, c * x + s * y - reach)
    return worst


@njit(cache=True)
def _leans(rotations: Array, up: Array) -> float:
    """Return the angle between `up` and the mean normal of two soles [rad]; 0 where these are not parallel."""
    apart = square = along = 0.0
    for a in range(3):
        one, other = rotations[0, a, 2], rotations[1, a, 2]
        apart += (one - other) ** 2
        square += (one + other) ** 2
        along += (one + other) * up[a]
    return math.acos(max(-1.0, min(1.0, along / math.sqrt(square)))) if apart < FLAT * FLAT else 0.0
