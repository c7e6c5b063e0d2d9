"""Turns a command into the nearest one that keeps every limit.

Limits are kept by clipping, not by stopping: an inverse kinematics that leans on a joint limit, or a leg policy that
asks for more torque than there is, is ordinary operation, and a stop would drop what the hand holds.
"""

from __future__ import annotations

import numpy as np

from golem.hardware.safety.base import EARLY, EASE, SPACE, Outgoing, SafetyLimits
from golem.hardware.safety.monitor import at_rest
from golem.types import NUM_JOINTS, Array, LowCommand, LowState

# Arrays instead of numbers: numpy then skips a conversion, a third of such an operation's time.
_ZERO = np.zeros(NUM_JOINTS)
BRAKE = 0.5
"""Share of the torque bound that brakes a joint which is too fast, or would come to rest beyond its range [own]."""
_MIN_STIFFNESS = np.full(NUM_JOINTS, 1e-9)


def limit_command(
    t: float,
    state: LowState,
    command: LowCommand,
    limits: SafetyLimits,
    last: Outgoing,
    dt: float,
    strained: bool = False,
) -> tuple[LowCommand, Outgoing]:
    """Return the limited command and what the next tick's slew limits refer to.

    In this order:

    1. Gains: 0 <= k <= k_max, rising by at most `k_rate * dt`.
    2. Position: into the commanded range, then at most `slew * dt` away from the last one. Towards a range's end
       the rate is at most sqrt(2 a d), d the distance left, so that the joint can follow to a halt.
    3. Feed-forward: at most `torque_rate * dt` away from the last one.
    4. Torque, |kp (q_cmd - q) + kd (dq_cmd - dq) + tau| <= L: the damping term alone is kept within L by scaling
       kd, then `tau` gives way, then the position is pulled towards the measured one. Only this pull may exceed the
       slew limit, and it can only lower the torque. A position far away is thus never stored as a spring, and the
       gravity torque survives as long as possible.

    Args:
        t: stamp of the result [s].
        state: measured state the torque is predicted at.
        command: finite command, arrays (27,).
        limits: the limits.
        last: what the previous call returned.
        dt: time since then [s].
        strained: whether a joint may be too fast, or too close to the end of its range for its speed. It is then
            driven on less, and braked in the end, whatever the command says, so that less is left for a stop to do.
    """
    minimum, maximum = np.minimum, np.maximum
    bound = limits.torque_command
    negative = -bound
    highest, lowest = bound, negative
    if strained:
        up, down = spared(
            state.q, state.dq, limits.deceleration, limits.velocity, limits.state_lower, limits.state_upper
        )
        highest, lowest = up * bound, -down * bound

    kp = minimum(maximum(command.kp, _ZERO), limits.kp_max)
    kp = minimum(kp, last.kp + limits.kp_rate * dt)
    kd = minimum(maximum(command.kd, _ZERO), limits.kd_max)
    kd = minimum(kd, last.kd + limits.kd_rate * dt)

    twice = limits.deceleration + limits.deceleration
    up = minimum(np.sqrt(twice * maximum(limits.upper - last.q, _ZERO)), limits.slew) * dt
    down = minimum(np.sqrt(twice * maximum(last.q - limits.lower, _ZERO)), limits.slew) * dt
    q = minimum(maximum(command.q, limits.lower), limits.upper)
    q = minimum(maximum(q, last.q - down), last.q + up)

    dq = minimum(maximum(command.dq, -limits.velocity), limits.velocity)
    damp = kd * (dq - state.dq)
    share = bound / maximum(np.abs(damp), bound)
    damp *= share
    tau = minimum(maximum(command.tau, negative), bound)
    if last.tau is not None:
        step = limits.torque_rate * dt
        tau = minimum(maximum(tau, last.tau - step), last.tau + step)
    rest = minimum(maximum(tau + damp, lowest), highest)
    soft = maximum(kp, _MIN_STIFFNESS)
    center = state.q - rest / soft
    q = minimum(maximum(q, center + lowest / soft), center + highest / soft)

    # Copies: whoever receives the command must not be able to reach into the memory.
    limited = LowCommand(t=t, q=q.copy(), dq=dq, tau=rest - damp, kp=kp.copy(), kd=kd * share)
    return limited, Outgoing(q, kp, kd, tau)


def spared(
    q: Array, dq: Array, deceleration: Array, velocity: Array, lower: Array, upper: Array
) -> tuple[Array, Array]:
    """Return which shares of their torque bounds may drive joints up and down; a negative one brakes.

    It is 1 far from both limits, 0 at the speed limit and where the joint would come to rest at the end of its range,
    and falls linearly in between, so that nothing chatters.

    Args:
        q: (..., n) positions [rad].
        dq: (..., n) speeds [rad/s].
        deceleration: (n,) what they can surely be braked with [rad/s^2].
        velocity: (n,) limits of speed [rad/s].
        lower: (n,) lower ends of their ranges [rad].
        upper: (n,) upper ends [rad].
    """
    minimum, maximum = np.minimum, np.maximum
    rest, ease = at_rest(q, dq, EARLY * deceleration), EASE * velocity
    up = minimum((velocity - dq) / ease, (upper - rest) / SPACE)
    down = minimum((velocity + dq) / ease, (rest - lower) / SPACE)
    return minimum(maximum(up, -BRAKE), 1.0), minimum(maximum(down, -BRAKE), 1.0)
