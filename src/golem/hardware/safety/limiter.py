"""Turns a command into the nearest one that keeps every limit.

Limits are kept by clipping, not by stopping: an inverse kinematics that leans on a joint limit, or a leg policy that
asks for more torque than there is, is ordinary operation, and a stop would drop what the hand holds. The arithmetic is
compiled; `tests/hardware/safety/slow_gate.py` has it in numpy.
"""

from __future__ import annotations

import numpy as np

from golem.hardware.safety.base import EARLY, EASE, SPACE, Outgoing, SafetyLimits
from golem.hardware.safety.kernel import BRAKE, limited
from golem.hardware.safety.monitor import at_rest
from golem.types import Array, LowCommand, LowState


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
        last: what the previous call returned.
        dt: time since then [s].
        strained: whether a joint may be too fast, or too close to the end of its range for its speed. It is then
            driven on less, and braked in the end, whatever the command says, so that less is left for a stop to do.
    """
    tau = command.tau if last.tau is None else last.tau
    numbers = np.concatenate(
        (command.q, command.dq, command.tau, command.kp, command.kd, state.q, state.dq, last.q, last.kp, last.kd, tau),
        dtype=np.float64,
    )
    rows = limited(numbers, limits.table, float(dt), last.tau is not None, strained)
    return LowCommand(t, *rows[:5]), Outgoing(*rows[5:])


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
