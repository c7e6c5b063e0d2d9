"""Postures that put the hands somewhere, from several starts: what a planner is given as goals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from golem.capabilities.arms.base import ARM_COLUMNS, NUM_UPPER
from golem.capabilities.arms.diff_ik import DiffIK
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.arms.task_space import TaskSpaceConfig
from golem.types import NUM_JOINTS, SIDES, UPPER, Array, Side

# Free of speed limits, one tick of dt = 1 s is one bounded Gauss-Newton step.
_OFFLINE = TaskSpaceConfig(
    arm_speed=0.5, torso_speed=0.2, posture_weight=1e-5, torso_weight=1e-4, palm_speed=0.2, palm_turn=1.0,
    error_damping=1e-2, collision_rows=0,
)  # fmt: skip
# Slower: it goes around its own links instead of through them.
_AROUND = replace(_OFFLINE, collision_rows=6, clearance=0.002, collision_gain=0.5, arm_speed=0.25)
ITERATIONS = 60
POSITION = 0.0005
"""Distance of a hand from its target that counts as there [m]."""
ROTATION = 0.005
"""Angle from it that does [rad]."""
STALLED = 15
"""Steps without progress after which a start is given up."""
NAMED = 3
"""Starts that are no random ones."""
ALIKE = 0.05
"""Two postures nearer than this are one goal [rad]."""


class GoalPostures:
    """Finds postures in the gate's range; `nearest` is how near the last search brought the farther hand [m]."""

    def __init__(self) -> None:
        self._ik, self._around = DiffIK(_OFFLINE), DiffIK(_AROUND)
        self.nearest = np.inf

    def find(
        self,
        T_left: Array | None,
        T_right: Array | None,
        q: Array,
        free: Callable[[Array], bool],
        most: int = 3,
        random_starts: int = 4,
        seed: int = 0,
    ) -> Array:
        """Return (k, 15) free postures with the hands at their targets, the one nearest to `q` first; k may be 0.

        Args:
            T_left: (4, 4) pose of `left_gripper` in base_link; None leaves that arm as it is.
            T_right: (4, 4) pose of `right_gripper` in base_link, or None.
            q: (15,) where the joints are [rad].
            free: says of a posture (15,) whether it may be gone to.
            most: how many are enough.
            random_starts: how many starts besides `q` and the named postures are tried while none is found.

        Raises:
            TargetError: a target is no rigid transform.
        """
        rng = np.random.default_rng(seed)
        found: list[Array] = []
        self.nearest = np.inf
        starts = [q, *(self._mixed(q, POSTURES[name], T_left, T_right) for name in ("ready", "home"))]
        starts += [
            self._mixed(q, rng.uniform(self._ik.lower, self._ik.upper), T_left, T_right) for _ in range(random_starts)
        ]
        for ik in (self._ik, self._around):
            for i, start in enumerate(starts):
                if len(found) >= most or (found and i >= NAMED):
                    break
                end = self._descend(ik, start, T_left, T_right)
                if end is not None and free(end) and all(np.abs(end - one).max() > ALIKE for one in found):
                    found.append(end)
            if found:
                break
        found.sort(key=lambda one: float(np.abs(one - q).max()))
        return np.array(found).reshape(-1, NUM_UPPER)

    def pose(self, side: Side, q: Array) -> Array:
        """Return the (4, 4) pose of the grasp frame of `side` in base_link at `q` (15,) [rad]."""
        return self._ik.kinematics.pose(side, q).copy()

    def _mixed(self, q: Array, other: Array, T_left: Array | None, T_right: Array | None) -> Array:
        """Return `q` with the arms that have a target as in `other`, and the torso half way."""
        out = q.copy()
        for side, T in zip(SIDES, (T_left, T_right), strict=True):
            if T is not None:
                out[ARM_COLUMNS[side]] = other[ARM_COLUMNS[side]]
        out[0] = np.clip(0.5 * q[0], self._ik.lower[0], self._ik.upper[0])
        return out

    def _descend(self, ik: DiffIK, start: Array, T_left: Array | None, T_right: Array | None) -> Array | None:
        """Return the posture that the targets are reached in from `start`, or None."""
        q = np.zeros(NUM_JOINTS)
        q[UPPER] = start
        ik.reset(q)
        best, since = np.inf, 0
        for _ in range(ITERATIONS):
            command = ik.step(T_left, T_right, q, 1.0)
            position, rotation = command.error_position.max(), command.error_rotation.max()
            if position < 1e-5 and rotation < 1e-4:
                break
            score = position + 0.1 * rotation
            best, since = (score, 0) if score < 0.98 * best else (best, since + 1)
            if since >= STALLED:
                break
        self.nearest = min(self.nearest, float(position))
        return command.q.copy() if position < POSITION and rotation < ROTATION else None
