"""What works against the legs: arm and waist motions, payloads and pushes, each with a difficulty that grows.

The upper body is the adversary of the paper's two-player game. Its first form is a curriculum of random motions
between postures, ordered by how far and how fast they go; its second is a learned policy (see `train`), which chooses
the velocities of the targets within the same bounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.arms.postures import POSTURES
from golem.robots.model.table import load_limits
from golem.types import UPPER, Array

NUM_UPPER = UPPER.stop - UPPER.start
GENTLE = 0.3
"""Fastest motion of the upper body in a calm episode [rad/s]."""
STRAIGHT = 0.7
"""Share of the pushes straight ahead, back or to a side. Each wants steps of its own kind: to a side the legs are in
each other's way, behind the feet are short, and with few pushes ahead the robot fell forward first."""
Quarters = tuple[float, float, float, float]
"""Shares of the straight pushes ahead, to the left, back and to the right."""
TOP_SPEED = 2.5
"""Speed of a target at full difficulty [rad/s]; the safety gate lets 3 pass."""


@dataclass
class Difficulty:
    """How hard it is made for the legs, 0 to 1 each.

    Attributes:
        amplitude: share of the joint ranges that upper-body targets use.
        speed: share of `TOP_SPEED`.
        push: share of the largest impulse.
        payload: share of the largest payload.
        strictness: share of the price of fast legs and dragging feet that is paid by who has nothing left to lose; see
            `Rewards`.
    """

    amplitude: float = 0.2
    speed: float = 0.2
    push: float = 0.1
    payload: float = 0.0
    strictness: float = 0.0


class UpperBodyMotion:
    """Joint targets (n, 15) [rad] of torso and arms for `n` robots, in motor order of the upper body."""

    def __init__(self, n: int, rng: np.random.Generator) -> None:
        limits = load_limits()
        middle = 0.5 * (limits.lower + limits.upper)[UPPER]
        half = 0.45 * (limits.upper - limits.lower)[UPPER]  # the gate's middle 90 %
        half[0] = min(half[0], 1.2)  # further round, the arms are behind the robot
        self._lower, self._upper = middle - half, middle + half
        self._home = np.stack([POSTURES["home"], POSTURES["ready"], np.zeros(NUM_UPPER)])
        self._rng = rng
        self.target: Array = np.tile(POSTURES["home"], (n, 1))
        self._goal: Array = self.target.copy()
        self._speed: Array = np.zeros((n, 1))
        self._left: Array = np.zeros(n)
        self._centre: Array = self.target.copy()
        self._calm: NDArray[np.bool_] = np.zeros(n, dtype=bool)

    def reset(self, where: NDArray[np.intp], amplitude: float, calm: NDArray[np.bool_]) -> None:
        """Start the robots `where` at a posture of their own, still; those that are `calm` (m,) move gently."""
        self._calm[where] = calm
        self._centre[where] = self._home[self._rng.integers(len(self._home), size=len(where))]
        self.target[where] = self._draw(where, amplitude)
        self._goal[where] = self.target[where]
        self._left[where] = self._rng.uniform(0.5, 3.0, len(where))

    def step(self, difficulty: Difficulty, dt: float) -> None:
        """Move every target towards its goal; where one has waited long enough, draw the next."""
        self._left -= dt
        due = np.flatnonzero(self._left <= 0.0)
        if len(due):
            self._goal[due] = self._draw(due, difficulty.amplitude)
            fastest = np.where(self._calm[due], GENTLE, max(TOP_SPEED * difficulty.speed, 0.3))
            self._speed[due, 0] = self._rng.uniform(0.2, fastest)
            self._left[due] = self._rng.uniform(0.4, 4.0, len(due))
        reach = self._speed * dt
        self.target = self.target + np.clip(self._goal - self.target, -reach, reach)

    def steer(self, where: NDArray[np.intp], action: Array, difficulty: Difficulty, dt: float) -> None:
        """Let the learned adversary move the targets of `where`: `action` (m, 15) are speeds in units of the bound."""
        fastest = np.where(self._calm[where], GENTLE, TOP_SPEED * max(difficulty.speed, 0.2))
        speed = fastest[:, None] * np.clip(action, -1.0, 1.0)
        lower = self._centre[where] + difficulty.amplitude * (self._lower - self._centre[where])
        upper = self._centre[where] + difficulty.amplitude * (self._upper - self._centre[where])
        self.target[where] = np.clip(self.target[where] + speed * dt, lower, upper)
        self._goal[where] = self.target[where]

    def _draw(self, where: NDArray[np.intp], amplitude: float) -> Array:
        centre = self._centre[where]
        anywhere = self._rng.uniform(self._lower, self._upper, centre.shape)
        moved = self._rng.random(centre.shape) < 0.8
        return centre + amplitude * self._rng.random((len(where), 1)) * np.where(moved, anywhere - centre, 0.0)


class RandomPushes:
    """Horizontal forces on torso or pelvis of `n` robots: short knocks and slow rods.

    Attributes:
        force: (n, 3) present force [N], world.
        on_torso: (n,) whether it acts on the torso, else on the pelvis.
        since: (n,) time since the newest push began [s]; infinite before the first.
    """

    def __init__(self, n: int, largest: float, quarters: Quarters, rng: np.random.Generator) -> None:
        """Push with impulses up to `largest` [N s], the straight ones in shares of `quarters`."""
        self._largest, self._quarters, self._rng = largest, quarters, rng
        self.since: Array = np.full(n, np.inf)
        self.force: Array = np.zeros((n, 3))
        self.on_torso: NDArray[np.bool_] = np.ones(n, dtype=bool)
        self._peak: Array = np.zeros((n, 2))
        self._start: Array = np.full(n, np.inf)
        self._duration: Array = np.ones(n)
        self._slow: NDArray[np.bool_] = np.zeros(n, dtype=bool)
        self._t: Array = np.zeros(n)
        self._calm: NDArray[np.bool_] = np.zeros(n, dtype=bool)

    def reset(self, where: NDArray[np.intp], difficulty: float, calm: NDArray[np.bool_]) -> None:
        """Leave the robots `where` alone for a while, and those that are `calm` (m,) for the whole episode."""
        self._calm[where] = calm
        self._t[where] = 0.0
        self.since[where] = np.inf
        self._draw(where, difficulty)

    def once(self, force: Array, duration: float, start: float | Array) -> None:
        """Push each robot's torso once, `force` (n, 2) in its heading frame [N], `start` [s] from now, or (n,)."""
        self._calm[:], self._slow[:], self.on_torso[:] = True, False, True
        self._peak[:], self._duration[:], self._start[:] = force, duration, self._t + start

    def step(self, difficulty: float, facing: Array, dt: float) -> None:
        """Advance the time, and draw anew where a push is over.

        Args:
            difficulty: share of the largest impulse.
            facing: (n, 2, 2) heading frame of each robot in the world, from `heading_frame`: a push has a direction
                relative to the robot.
            dt: time since the previous step [s].
        """
        self._t += dt
        over = np.flatnonzero(self._t > self._start + self._duration)
        if len(over):
            self._draw(over, difficulty)
        share = (self._t - self._start) / self._duration
        profile = np.where(self._slow, np.sin(np.pi * np.clip(share, 0.0, 1.0)), 1.0)
        pushed = (share >= 0.0) & (share <= 1.0)
        profile = profile * pushed
        self.since = np.where(pushed & self._peak.any(axis=1), self._t - self._start, self.since + dt)
        self.force[:, :2] = np.einsum("nij,nj->ni", facing, self._peak) * profile[:, None]

    def _draw(self, where: NDArray[np.intp], difficulty: float) -> None:
        rng, m = self._rng, len(where)
        slow = rng.random(m) < 0.25
        duration = np.where(slow, rng.uniform(0.5, 1.2, m), rng.uniform(0.1, 0.4, m))
        # Mostly near the edge of what the robot is known to take: easy pushes teach little.
        impulse = self._largest * difficulty * np.sqrt(rng.random(m))
        force = impulse / duration * np.where(slow, 0.5 * np.pi, 1.0) * ~self._calm[where]
        straight = 0.5 * np.pi * rng.choice(4, size=m, p=self._quarters) + rng.uniform(-0.3, 0.3, m)
        angle = np.where(rng.random(m) < STRAIGHT, straight, rng.uniform(-np.pi, np.pi, m))
        self._peak[where] = force[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        self._duration[where] = duration
        self._slow[where] = slow
        self._start[where] = self._t[where] + rng.uniform(1.5, 6.0, m)
        self.on_torso[where] = np.where(slow, rng.random(m) < 0.2, rng.random(m) < 0.8)
