"""Inverse kinematics from many starts: how the named postures were chosen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from golem.capabilities.arms.base import TargetError
from golem.capabilities.arms.diff_ik import DiffIK
from golem.capabilities.arms.task_space import TaskSpaceConfig
from golem.types import NUM_JOINTS, SIDES, UPPER, Array, Side

# Free of speed limits, one tick of dt = 1 s is one Gauss-Newton step of at most 0.5 rad per joint; the soft tasks
# only break ties.
_OFFLINE = TaskSpaceConfig(
    arm_speed=0.5, torso_speed=0.2, posture_weight=1e-8, torso_weight=1e-6, palm_speed=0.2, palm_turn=1.0,
    error_damping=1e-2, limit_margin=0.05, collision_rows=0,
)  # fmt: skip
_ITERATIONS = 120


def solve_posture(
    T_left: Array | None,
    T_right: Array | None,
    starts: Array,
    *,
    torso_range: float = 0.5,
    position_tolerance: float = 1e-4,
    rotation_tolerance: float = 1e-3,
) -> Array:
    """Return the most comfortable posture that puts the hands where they shall be.

    Comfort is the smaller of margin / 0.25 rad and manipulability / 0.12 over the arms that have a target: the two
    scales are what a well-placed arm reaches, so that neither buys off the other.

    Args:
        T_left: (4, 4) pose of `left_gripper` in base_link; None leaves that arm as the start has it.
        T_right: (4, 4) pose of `right_gripper` in base_link, or None.
        starts: (n, 15) postures to start from [rad].
        torso_range: how far the torso may turn either way [rad].
        position_tolerance: distance that counts as reached [m].
        rotation_tolerance: angle that counts as reached [rad].

    Returns:
        (15,) joints of torso, left arm, right arm [rad].

    Raises:
        TargetError: none of the starts leads to the targets.
    """
    ik = DiffIK(replace(_OFFLINE, torso_range=torso_range))
    # Comfort counts from the stops, so the search may go near them; `ready` and `home` are inside the gate's range.
    ik.lower[1:], ik.upper[1:] = (
        stop[1:] + sign * _OFFLINE.limit_margin for stop, sign in zip(ik.kinematics.stops, (1, -1), strict=True)
    )
    sides: list[Side] = [side for side, T in zip(SIDES, (T_left, T_right), strict=True) if T is not None]
    best: tuple[float, Array] | None = None
    nearest = np.inf
    for start in np.atleast_2d(starts):
        q = np.zeros(NUM_JOINTS)
        q[UPPER] = start
        ik.reset(q)
        for _ in range(_ITERATIONS):
            command = ik.step(T_left, T_right, q, 1.0)
            if command.error_position.max() < 1e-6 and command.error_rotation.max() < 1e-5:
                break
        nearest = min(nearest, float(command.error_position.max()))
        reached = command.error_position.max() < position_tolerance
        if reached and command.error_rotation.max() < rotation_tolerance:
            score = comfort(ik, sides, command.q)
            if best is None or score > best[0]:
                best = (score, command.q)
    if best is None:
        raise TargetError(
            f"No posture reaches the targets from {len(np.atleast_2d(starts))} starts; the nearest came within "
            f"{nearest:.3f} m. Move the targets, allow the torso more range, or give more starts."
        )
    return best[1]


def comfort(ik: DiffIK, sides: list[Side], q: Array) -> float:
    """Return how far `q` (15,) is from limits and singularities; 1 is a well-placed arm, 0 the edge."""
    scores = [1.0]
    for side in sides:
        scores.append(ik.kinematics.margin(side, q) / 0.25)
        scores.append(ik.kinematics.manipulability(side, q) / 0.12)
    return min(scores)
