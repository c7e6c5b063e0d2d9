"""Judges whether the sensors live, and whether what they say can be true.

A real sensor's last digit never rests, so a limb or an IMU that repeats its numbers has stopped measuring, whatever its
tick does. What lives is held against what else is known: a joint's position against its speed, the IMU's orientation
against its rate and against gravity, a motor's torque against the one it was asked for. One sample that cannot be true
is dropped; a run of them is a fault.

Everything but the jump of a position is judged at every fifth sample, which is soon enough and keeps a tick short.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from golem.hardware.safety.base import STANDING, SafetyLimits
from golem.interfaces.payloads import Fault, Reason
from golem.robots.model.table import JOINT_NAMES
from golem.types import NUM_JOINTS, TICK, Array, Imu, LowCommand, LowState

EVERY = 5
"""Samples from one look at life and plausibility to the next."""
LIMBS = {
    "left leg": slice(0, 6),
    "right leg": slice(6, 12),
    "torso": slice(12, 13),
    "left arm": slice(13, 20),
    "right arm": slice(20, 27),
}
"""Joints that share a bus, and so a fate."""
GROUPS = (*LIMBS, "IMU")
LOST = 0.05
"""Time between two looks beyond which nothing is held against the last one [s]."""
FORGET = 1.0
"""Time constant with which a difference between two sensors is forgotten [s] [own]."""
GRAVITY_TIME = 0.5
"""Time constant of the mean specific force, and how long a robot has to be calm for it to be judged [s]."""
DELAYS = 6
"""Looks over which a command may take to reach its motor: 50 ms."""
CALM = 0.3
"""Rate of the torso below which the robot hardly moves [rad/s]."""


@dataclass(frozen=True, slots=True)
class SensesMemory:
    """What is remembered of the samples so far.

    Attributes:
        tick: the robot's time of the newest accepted sample [s].
        q: (27,) its positions [rad]; None before the first.
        count: samples accepted.
        bad: level of the samples that were dropped.
        looked: the sample looked at last, with its time.
        raw: its numbers by group of `GROUPS`.
        since: since when each group has had them [s].
        drift: (27,) position minus integrated speed, fading [rad].
        turn: (3,) orientation minus integrated rate, fading, in the IMU's frame [rad].
        force: (3,) mean specific force [m/s^2].
        restless: when the torso turned quickly last [s].
        asked: what the motors were asked for at the looks of late, see `_asked`; None while no command passes.
        dead: (27,) for how long each motor has not followed [s].
    """

    tick: float = -math.inf
    q: Array | None = None
    count: int = 0
    bad: float = 0.0
    looked: LowState | None = None
    looked_at: float = -math.inf
    raw: tuple[bytes, ...] = (b"",) * len(GROUPS)
    since: tuple[float, ...] = (0.0,) * len(GROUPS)
    drift: Array = field(default_factory=lambda: np.zeros(NUM_JOINTS))
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    force: tuple[float, float, float] | None = None
    restless: float = -math.inf
    asked: Array | None = None
    dead: Array = field(default_factory=lambda: np.zeros(NUM_JOINTS))


def sense(
    state: LowState,
    tick: float,
    memory: SensesMemory,
    limits: SafetyLimits,
    sent: LowCommand | None,
) -> tuple[SensesMemory, bool, Fault | None]:
    """Judge one new sample.

    Args:
        state: one that is finite.
        tick: the robot's own time of it [s].
        memory: of the samples before it.
        limits: what to compare with.
        sent: what the motors were told last while commands pass; None else, and a jump is then believed.

    Returns:
        The new memory, whether the sample is to be believed, and the fault if one has persisted.
    """
    apart, q = tick - memory.tick, memory.q
    if q is not None and 0.0 < apart < LOST:
        moved = np.abs(state.q - q)
        if np.count_nonzero(moved > limits.jump * max(1.0, apart / TICK)):
            return _jumped(state, tick, memory, limits, moved, sent is not None)
    count = memory.count + 1
    bad = max(0.0, memory.bad - limits.frame_leak)
    if count % EVERY:
        return _kept(memory, tick, state.q, count, bad), True, None
    memory, fault = _look(
        state, tick, replace(memory, tick=tick, q=state.q, count=count, bad=bad), limits, sent
    )
    return memory, True, fault


def _kept(m: SensesMemory, tick: float, q: Array, count: int, bad: float) -> SensesMemory:
    """Return `m` with a newer sample; `replace` would take ten times the time."""
    return SensesMemory(
        tick,
        q,
        count,
        bad,
        m.looked,
        m.looked_at,
        m.raw,
        m.since,
        m.drift,
        m.turn,
        m.force,
        m.restless,
        m.asked,
        m.dead,
    )


def _jumped(
    state: LowState, tick: float, memory: SensesMemory, limits: SafetyLimits, moved: Array, active: bool
) -> tuple[SensesMemory, bool, Fault | None]:
    bad = memory.bad + 1.0
    if active:
        memory = replace(memory, bad=bad)
    else:
        memory = replace(memory, bad=min(bad, limits.bad_frames), q=state.q, tick=tick)
    if bad < limits.bad_frames:
        return memory, False, None
    i = int(np.argmax(moved))
    legs = bool(moved[STANDING].max() > limits.jump)
    return (
        memory,
        False,
        Fault(Reason.STATE_IMPLAUSIBLE, f"{JOINT_NAMES[i]} jumped by {moved[i]:.2f} rad", stands=not legs),
    )


def _look(
    state: LowState, tick: float, m: SensesMemory, limits: SafetyLimits, sent: LowCommand | None
) -> tuple[SensesMemory, Fault | None]:
    """Judge life and plausibility of `state` against the sample looked at before."""
    raw = _raw(state) if limits.frozen else m.raw
    before, dt = m.looked, tick - m.looked_at
    if before is None or not 0.0 < dt < LOST:
        calm = replace(m, looked=state, looked_at=tick, raw=raw, since=(tick,) * len(GROUPS))
        return calm, None
    since = tuple(old if a == b else tick for a, b, old in zip(raw, m.raw, m.since, strict=True))
    keep = 1.0 - dt / FORGET
    speed = state.dq + before.dq
    drift = keep * m.drift + (state.q - before.q) - (0.5 * dt) * speed
    turn = _turned(before.imu, state.imu, dt, m.turn, keep)
    force = _mean(m.force, state.imu.acc, dt)
    restless = tick if np.abs(state.imu.gyro).max() > CALM else m.restless
    dead, asked = m.dead, None
    if sent is not None:
        asked = _asked(m.asked, sent)
        # By none of the commands of late: which of them the motors have by now depends on their delay.
        torque = np.abs(asked[0] - asked[1] * state.q - asked[2] * state.dq).min(axis=0)
        weak = (torque > limits.dead_load * limits.torque) & (np.abs(state.tau) < limits.dead_share * torque)
        dead = (dead + dt) * weak
    after = SensesMemory(
        m.tick, m.q, m.count, m.bad, state, tick, raw, since, drift, turn, force, restless, asked, dead
    )
    return after, (
        _frozen(after, limits)
        or _drifts(after, speed, limits)
        or _imu(after, state, limits)
        or _dead(after, limits)
    )


def _asked(before: Array | None, sent: LowCommand) -> Array:
    """Return the (3, `DELAYS`, 27) constant torque, stiffness and damping of the commands at the looks of late."""
    new = np.stack((sent.kp * sent.q + sent.kd * sent.dq + sent.tau, sent.kp, sent.kd))[:, None]
    return np.repeat(new, DELAYS, axis=1) if before is None else np.concatenate((before[:, 1:], new), axis=1)


def _raw(state: LowState) -> tuple[bytes, ...]:
    q, dq, tau, imu = state.q.tobytes(), state.dq.tobytes(), state.tau.tobytes(), state.imu
    limbs = (slice(8 * part.start, 8 * part.stop) for part in LIMBS.values())
    motors = [q[part] + dq[part] + tau[part] for part in limbs]
    return (*motors, imu.quat.tobytes() + imu.gyro.tobytes() + imu.acc.tobytes())


def _frozen(m: SensesMemory, limits: SafetyLimits) -> Fault | None:
    """A group has said the same since before the look that showed it first."""
    if not limits.frozen:
        return None
    still = m.tick - min(m.since)
    if still < limits.frozen - EVERY * TICK - 1e-6:
        return None
    names = [g for g, s in zip(GROUPS, m.since, strict=True) if s == min(m.since)]
    stands = all(name.endswith("arm") for name in names)
    return Fault(Reason.STATE_FROZEN, f"{', '.join(names)} for {still * 1e3:.0f} ms", stands)


def _drifts(m: SensesMemory, speed: Array, limits: SafetyLimits) -> Fault | None:
    beyond = np.abs(m.drift) - limits.drift_lag * np.abs(speed)
    i = int(beyond.argmax())
    if beyond[i] <= limits.drift:
        return None
    stands = i >= STANDING.stop and bool(beyond[STANDING].max() <= limits.drift)
    return Fault(
        Reason.STATE_IMPLAUSIBLE,
        f"{JOINT_NAMES[i]} is {m.drift[i]:.2f} rad from its speed's integral",
        stands,
    )


def _imu(m: SensesMemory, state: LowState, limits: SafetyLimits) -> Fault | None:
    apart = math.hypot(*m.turn)
    if apart > limits.imu_drift:
        return Fault(Reason.IMU_IMPLAUSIBLE, f"orientation and rate differ by {apart:.2f} rad")
    force = m.force
    if force is None:
        return None
    size = math.hypot(*force)
    calm = m.tick - m.restless >= GRAVITY_TIME
    low, high = limits.gravity if calm else limits.gravity_moving
    if not low <= size <= high:
        return Fault(Reason.IMU_IMPLAUSIBLE, f"specific force of {size:.1f} m/s^2")
    if not calm:
        return None
    angle = math.acos(max(-1.0, min(1.0, sum(map(_times, _up(state.imu.quat), force)) / size)))
    if angle > limits.gravity_angle:
        return Fault(Reason.IMU_IMPLAUSIBLE, f"gravity is {math.degrees(angle):.0f} degrees off its up")
    return None


def _dead(m: SensesMemory, limits: SafetyLimits) -> Fault | None:
    i = int(m.dead.argmax())
    if m.dead[i] < limits.dead_time:
        return None
    legs = bool(m.dead[STANDING].max() >= limits.dead_time)
    return Fault(Reason.MOTOR_DEAD, f"{JOINT_NAMES[i]} has no torque", stands=not legs)


def _turned(
    before: Imu, now: Imu, dt: float, turn: tuple[float, float, float], keep: float
) -> tuple[float, float, float]:
    """Return `turn` with what the orientation turned beyond the mean rate, for small angles."""
    pw, px, py, pz = before.quat.tolist()
    w, x, y, z = now.quat.tolist()
    scale = math.copysign(2.0, pw * w + px * x + py * y + pz * z)
    ax = scale * (pw * x - px * w - py * z + pz * y)
    ay = scale * (pw * y + px * z - py * w - pz * x)
    az = scale * (pw * z - px * y + py * x - pz * w)
    gx, gy, gz = ((0.5 * dt) * (before.gyro + now.gyro)).tolist()
    tx, ty, tz = turn
    return keep * tx + ax - gx, keep * ty + ay - gy, keep * tz + az - gz


def _mean(force: tuple[float, float, float] | None, acc: Array, dt: float) -> tuple[float, float, float]:
    ax, ay, az = acc.tolist()
    if force is None:
        return ax, ay, az
    share = dt / GRAVITY_TIME
    x, y, z = force
    return x + share * (ax - x), y + share * (ay - y), z + share * (az - z)


def _up(quat: Array) -> tuple[float, float, float]:
    """Return the world's up in the frame of orientation `quat` wxyz."""
    w, x, y, z = quat.tolist()
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def _times(a: float, b: float) -> float:
    return a * b
