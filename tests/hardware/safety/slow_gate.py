"""The gate's compiled arithmetic once more, in plain numpy: what the tests hold it against."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from golem.hardware.safety.base import EARLY, EASE, SPACE, Outgoing, SafetyLimits
from golem.types import NUM_JOINTS, Array, Imu, LowCommand, LowState

BRAKE, DELAYS, FORGET, GRAVITY_TIME = 0.5, 6, 4.0, 0.5


def slow_limit(
    state: LowState, command: LowCommand, limits: SafetyLimits, last: Outgoing, dt: float, strained: bool
) -> tuple[tuple[Array, ...], Outgoing]:
    """Return q, dq, tau, kp, kd of the limited command, and what is remembered of it."""
    bound, velocity, braking = limits.torque_command, limits.velocity, limits.deceleration
    highest, lowest = bound, -bound
    if strained:
        rest = state.q + state.dq * np.abs(state.dq) / (2.0 * EARLY * braking)
        up = np.minimum((velocity - state.dq) / (EASE * velocity), (limits.state_upper - rest) / SPACE)
        down = np.minimum((velocity + state.dq) / (EASE * velocity), (rest - limits.state_lower) / SPACE)
        highest, lowest = np.clip(up, -BRAKE, 1.0) * bound, -np.clip(down, -BRAKE, 1.0) * bound
    kp = np.minimum(np.clip(command.kp, 0.0, limits.kp_max), last.kp + limits.kp_rate * dt)
    kd = np.minimum(np.clip(command.kd, 0.0, limits.kd_max), last.kd + limits.kd_rate * dt)
    up = np.minimum(np.sqrt(2.0 * braking * np.maximum(limits.upper - last.q, 0.0)), limits.slew) * dt
    down = np.minimum(np.sqrt(2.0 * braking * np.maximum(last.q - limits.lower, 0.0)), limits.slew) * dt
    q = np.clip(np.clip(command.q, limits.lower, limits.upper), last.q - down, last.q + up)
    dq = np.clip(command.dq, -velocity, velocity)
    damp = kd * (dq - state.dq)
    share = bound / np.maximum(np.abs(damp), bound)
    damp = damp * share
    tau = np.clip(command.tau, -bound, bound)
    if last.tau is not None:
        tau = np.clip(tau, last.tau - limits.torque_rate * dt, last.tau + limits.torque_rate * dt)
    constant = np.minimum(np.maximum(tau + damp, lowest), highest)
    soft = np.maximum(kp, 1e-9)
    center = state.q - constant / soft
    q = np.minimum(np.maximum(q, center + lowest / soft), center + highest / soft)
    return (q, dq, constant - damp, kp, kd * share), Outgoing(q, kp, kd, tau)


@dataclass(frozen=True)
class SlowLook:
    """What looks at a robot's samples have found so far; `same` is of the newest one, by limb and of the IMU."""

    state: LowState
    newest: LowState
    drift: Array
    dead: Array
    asked: tuple[LowCommand, ...]
    turn: Array
    force: Array | None = None
    same: tuple[bool, ...] = ()

    @classmethod
    def at(cls, state: LowState) -> SlowLook:
        """Begin with `state`."""
        zeros = np.zeros(NUM_JOINTS)
        return cls(state, state, zeros, zeros, (), np.zeros(3))

    def follow(self, new: LowState) -> SlowLook:
        """Take the sample `new`, whether it is looked at or not."""
        old, dt = self.newest, new.t - self.newest.t
        drift = (1.0 - dt / FORGET) * self.drift + (new.q - old.q) - 0.5 * dt * (new.dq + old.dq)
        return replace(self, newest=new, drift=drift)

    def add(self, new: LowState, dt: float, sent: LowCommand | None, limits: SafetyLimits) -> SlowLook:
        """Look at `new`, `dt` after the one before."""
        keep, old = 1.0 - dt / FORGET, self.state
        turn = keep * self.turn + _turn(old.imu, new.imu) - 0.5 * dt * (old.imu.gyro + new.imu.gyro)
        mean = new.imu.acc if self.force is None else self.force
        force = mean + dt / GRAVITY_TIME * (new.imu.acc - mean)
        dead, asked = self.dead, ()
        if sent is not None:
            asked = ((self.asked or (sent,) * DELAYS) + (sent,))[-DELAYS:]
            torques = [np.abs(c.kp * (c.q - new.q) + c.kd * (c.dq - new.dq) + c.tau) for c in asked]
            least = np.min(torques, axis=0)
            weak = (least > limits.dead_load * limits.torque) & (np.abs(new.tau) < limits.dead_share * least)
            dead = (dead + dt) * weak
        parts = [slice(0, 6), slice(6, 12), slice(12, 13), slice(13, 20), slice(20, 27)]
        same = [_equal(new, old, part) for part in parts]
        imus = [(new.imu.quat, old.imu.quat), (new.imu.gyro, old.imu.gyro), (new.imu.acc, old.imu.acc)]
        same.append(all(np.array_equal(a, b) for a, b in imus))
        return replace(self, state=new, dead=dead, asked=asked, turn=turn, force=force, same=tuple(same))


def _equal(a: LowState, b: LowState, part: slice) -> bool:
    return all(np.array_equal(x[part], y[part]) for x, y in ((a.q, b.q), (a.dq, b.dq), (a.tau, b.tau)))


def _turn(before: Imu, now: Imu) -> Array:
    """Return the turn between two orientations, a small rotation vector in the frame of `before`."""
    w, v = before.quat[0], -before.quat[1:]
    scalar = w * now.quat[0] - v @ now.quat[1:]
    vector = w * now.quat[1:] + now.quat[0] * v + np.cross(v, now.quat[1:])
    return math.copysign(2.0, scalar) * vector
