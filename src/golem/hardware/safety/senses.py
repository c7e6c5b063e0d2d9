"""Judges whether the sensors live, and whether what they say can be true.

A real sensor's last digit never rests, so a limb or an IMU that repeats its numbers has stopped measuring, whatever its
tick does. What lives is held against what else is known: a joint's position against its speed, the IMU's orientation
against its rate and against gravity, a motor's torque against the one it was asked for. One sample that cannot be true
is dropped; a run of them is a fault.

Jump and integral of a position take every sample; all else is judged every 10 ms of the robot's time, which is soon
enough and keeps a tick short.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from golem.hardware.safety.base import STANDING, SafetyLimits
from golem.hardware.safety.gate_balance import carried, no_balance, sensed, unbalanced
from golem.hardware.safety.senses_kernel import ASKED, DELAYS, FIRST, SCALARS, looked
from golem.interfaces.payloads import Fault, Reason
from golem.native import Records
from golem.robots.model.table import JOINT_NAMES
from golem.types import NUM_JOINTS, TICK, Array, LowCommand, LowState

EVERY = 5
"""Samples from one look at life and plausibility to the next."""
LOOK = (EVERY - 0.5) * TICK
"""Robot time from which on the next one is due [s]."""
STEADY = 0.012
"""Time between two samples beyond which their speeds do not tell how far a joint has gone [s] [own]."""
LIMBS = {
    name: slice(*ends)
    for name, ends in zip(("left leg", "right leg", "torso", "left arm", "right arm"), pairwise(FIRST), strict=True)
}
"""Joints that share a bus, and so a fate."""
GROUPS = (*LIMBS, "IMU")
LOST = 0.05
"""Time between two looks beyond which nothing is held against the last one [s]."""
FORGET = 4.0
"""Time constant with which a difference between two sensors is forgotten [s] [own]."""
GRAVITY_TIME = 0.5
"""Time constant of the mean specific force, and how long a robot has to be calm for it to be judged [s]."""
CALM = 0.3
"""Rate of the torso below which the robot hardly moves [rad/s]."""
SPIN = 40.0
"""Rate that no torso turns with between two looks [rad/s]: the gyroscope's range ends at 35."""
_ZERO, _NONE = np.zeros(NUM_JOINTS), np.zeros(ASKED)


@dataclass(frozen=True, slots=True)
class SensesMemory:
    """What is remembered of the samples so far.

    Attributes:
        tick: the robot's time of the newest accepted sample [s].
        q, dq: (27,) its positions [rad] and speeds [rad/s]; None before the first.
        bad: level of the samples that were dropped.
        looked: the sample looked at last, with its time.
        since: since when each group of `GROUPS` has had its numbers [s].
        drift: (27,) position minus integrated speed, fading [rad].
        turn: (3,) orientation minus integrated rate, fading, in the IMU's frame [rad].
        force: (3,) mean specific force [m/s^2].
        restless: when the torso turned quickly last [s].
        asked: (486,) what the motors were asked for at the looks of late, see `senses_kernel`; None while no command
            passes.
        dead: (27,) for how long each motor has not followed [s].
        balance: see `gate_balance`; `carries` and `unsteady` are what it says.
    """

    tick: float = -math.inf
    q: Array | None = None
    dq: Array | None = None
    bad: float = 0.0
    looked: LowState | None = None
    looked_at: float = -math.inf
    since: tuple[float, ...] = (0.0,) * len(GROUPS)
    drift: Array = field(default_factory=lambda: np.zeros(NUM_JOINTS))
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    force: tuple[float, float, float] | None = None
    restless: float = -math.inf
    asked: Array | None = None
    dead: Array = field(default_factory=lambda: np.zeros(NUM_JOINTS))
    balance: Records = field(default_factory=no_balance)
    carries: bool = False
    unsteady: Fault | None = None


def sense(
    state: LowState,
    tick: float,
    memory: SensesMemory,
    limits: SafetyLimits,
    sent: LowCommand | None,
    smooth: bool = False,
) -> tuple[SensesMemory, bool, Fault | None]:
    """Judge one new sample.

    Args:
        state: one that is finite.
        tick: the robot's own time of it [s].
        memory: of the samples before it.
        sent: what the motors were told last while something drives them; None else, and a jump is then believed.
        smooth: whether it is known that no joint has jumped.

    Returns:
        The new memory, whether the sample is to be believed, and the fault if one has persisted.
    """
    apart, q, dq = tick - memory.tick, memory.q, memory.dq
    if not smooth and q is not None and 0.0 < apart < LOST:
        moved = np.abs(state.q - q)
        if np.count_nonzero(moved > limits.jump * max(1.0, apart / TICK)):
            return _jumped(state, tick, memory, limits, moved, sent is not None)
    if sent is not None and memory.looked is not None and LOOK <= tick - memory.looked_at < LOST:
        turned = 2.0 * math.acos(min(1.0, abs(float(memory.looked.imu.quat @ state.imu.quat))))
        if turned > SPIN * (tick - memory.looked_at):
            memory = replace(memory, bad=memory.bad + 1.0)
            fault = Fault(Reason.IMU_IMPLAUSIBLE, f"orientation jumped by {turned:.2f} rad")
            return memory, False, fault if memory.bad >= limits.bad_frames else None
    bad, drift = max(0.0, memory.bad - limits.frame_leak), memory.drift
    if q is not None and dq is not None and 0.0 < apart <= STEADY:
        drift = (1.0 - apart / FORGET) * drift + (state.q - q) - (0.5 * apart) * (state.dq + dq)
    memory = _kept(memory, tick, state, bad, drift)
    if 0.0 <= tick - memory.looked_at < LOOK:
        return memory, True, None
    memory, fault = _look(state, tick, memory, limits, sent)
    return memory, True, fault


def _kept(m: SensesMemory, tick: float, state: LowState, bad: float, drift: Array) -> SensesMemory:
    """Return `m` with a newer sample; `replace` would take ten times the time."""
    return SensesMemory(
        tick, state.q, state.dq, bad, m.looked, m.looked_at, m.since, drift, m.turn, m.force, m.restless, m.asked,
        m.dead, m.balance, m.carries, m.unsteady,
    )  # fmt: skip


def _jumped(
    state: LowState, tick: float, memory: SensesMemory, limits: SafetyLimits, moved: Array, active: bool
) -> tuple[SensesMemory, bool, Fault | None]:
    bad = memory.bad + 1.0
    if active:
        memory = replace(memory, bad=bad)
    else:
        memory = replace(memory, bad=min(bad, limits.bad_frames), q=state.q, dq=state.dq, tick=tick)
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
    before, dt = m.looked, tick - m.looked_at
    if before is None or not 0.0 < dt < LOST:
        balance = sensed(m.balance, state, None, limits)
        m = replace(m, carries=carried(balance), unsteady=None)
        return replace(m, looked=state, looked_at=tick, since=(tick,) * len(GROUPS), balance=balance), None
    now, was = state.imu, before.imu
    force = now.acc if m.force is None else m.force
    # Which of the commands of late the motors have by now depends on their delay: a motor follows if it does one.
    told = (_ZERO,) * 5 if sent is None else (sent.q, sent.dq, sent.tau, sent.kp, sent.kd)
    asked = _NONE if sent is None else _asked(sent) if m.asked is None else m.asked
    new = (state.q, state.dq, state.tau, now.quat, now.gyro, now.acc)
    old = (before.q, before.dq, before.tau, was.quat, was.gyro, was.acc)
    numbers = np.concatenate((*new, *old, m.drift, m.dead, asked, *told, m.turn, force), dtype=np.float64)
    out = looked(
        numbers,
        limits.table,
        dt,
        1.0 - dt / FORGET,
        dt / GRAVITY_TIME,
        limits.drift_lag,
        limits.dead_load,
        limits.dead_share,
        sent is not None,
    )
    tx, ty, tz, fx, fy, fz, rate, drifts, dead, *same = out[SCALARS:].tolist()
    balance = sensed(m.balance, state, dt, limits)
    after = SensesMemory(
        m.tick, m.q, m.dq, m.bad, state, tick,
        tuple([since if repeats else tick for since, repeats in zip(m.since, same, strict=True)]), out[:NUM_JOINTS],
        (tx, ty, tz), (fx, fy, fz), tick if rate > CALM else m.restless,
        None if sent is None else out[2 * NUM_JOINTS : SCALARS], out[NUM_JOINTS : 2 * NUM_JOINTS], balance,
        carried(balance), unbalanced(balance),
    )  # fmt: skip
    return after, (
        _frozen(after, limits)
        or (_drifts(after, state.dq + before.dq, limits) if drifts > limits.drift else None)
        or _imu(after, state, limits)
        or (_dead(after, limits) if dead >= limits.dead_time else None)
    )


def _asked(sent: LowCommand) -> Array:
    """Return (486,) `sent` as all of the commands of late."""
    return np.repeat((sent.kp * sent.q + sent.kd * sent.dq + sent.tau, sent.kp, sent.kd), DELAYS, axis=0).ravel()


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


def _drifts(m: SensesMemory, speed: Array, limits: SafetyLimits) -> Fault:
    """A joint has left its speed's integral."""
    beyond = np.abs(m.drift) - limits.drift_lag * np.abs(speed)
    i = int(beyond.argmax())
    stands = i >= STANDING.stop and bool(beyond[STANDING].max() <= limits.drift)
    return Fault(
        Reason.STATE_IMPLAUSIBLE, f"{JOINT_NAMES[i]} is {m.drift[i]:.2f} rad from its speed's integral", stands
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


def _dead(m: SensesMemory, limits: SafetyLimits) -> Fault:
    """A motor does not follow."""
    i = int(m.dead.argmax())
    legs = bool(m.dead[STANDING].max() >= limits.dead_time)
    return Fault(Reason.MOTOR_DEAD, f"{JOINT_NAMES[i]} has no torque", stands=not legs)


def _up(quat: Array) -> tuple[float, float, float]:
    """Return the world's up in the frame of orientation `quat` wxyz."""
    w, x, y, z = quat.tolist()
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def _times(a: float, b: float) -> float:
    return a * b
