"""RRT-Connect (Kuffner and LaValle, 2000) on the compiled kernel: straight first, two trees next, then shortcuts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from golem.capabilities.planning import plan_kernel
from golem.capabilities.planning.base import PlanRefused, Refusal
from golem.capabilities.planning.joint_space import JointSpace
from golem.capabilities.planning.path_planner import FINE, STILL, Effort, PathPlanner, PathPlannerConfig
from golem.types import Array


class Straight(PathPlanner):
    """Goes straight to the first goal that it can go straight to."""

    def find(
        self, space: JointSpace, q: Array, goals: Array, rng: np.random.Generator, effort: Effort, attempt: int
    ) -> Array:
        line = straight_line(space, q, goals, effort, FINE)
        if line is None:
            raise PlanRefused(Refusal.NO_PATH, "Something is in the way of a straight line to every goal.")
        return line


def straight_line(space: JointSpace, q: Array, goals: Array, effort: Effort, step: float) -> Array | None:
    """Return the corners (2, 15) of the straight line from `q` (15,) to the nearest of `goals` (k, 15) with a free one.

    None: none has. Between two checks are `step` [rad in a joint].
    """
    for i in np.argsort(np.abs(goals - q).max(axis=1), kind="stable"):
        if effort.left <= 0:
            return None
        effort.spend(int(np.abs(goals[i] - q).max() / step) + 1)
        if space.verdict(goals[i]) == 0 and space.free_line(q, goals[i], step):
            return np.array([q, goals[i]])
    return None


BATCH = 64
"""Samples of one call of the kernel: between two calls the caller is asked whether it has given up."""
NODES = 20_000
"""Most nodes of a tree."""


@dataclass(frozen=True)
class RrtConnectConfig:
    """Options of `RrtConnect`.

    Attributes:
        path: margins, limits and effort.
        step: between two checks of the search [rad in a joint].
        reach: longest edge of a tree [rad in a joint].
        shortcuts: how often two points of the path are tried to be joined.
    """

    path: PathPlannerConfig = field(default_factory=PathPlannerConfig)
    step: float = 0.05
    reach: float = 0.8
    shortcuts: int = 80


class RrtConnect(PathPlanner):
    """Two trees of postures, from the start and from the goals, that grow towards each other."""

    def __init__(self, config: RrtConnectConfig | None = None) -> None:
        self._options = config or RrtConnectConfig()
        super().__init__(self._options.path)

    def find(
        self, space: JointSpace, q: Array, goals: Array, rng: np.random.Generator, effort: Effort, attempt: int
    ) -> Array:
        # A path that just touches a rule may slip through between two checks: the next one is checked more finely.
        step = max(FINE, self._options.step * 0.5**attempt)
        line = straight_line(space, q, goals, effort, step)
        if line is not None:
            return line
        return self._shortened(space, self._search(space, q, goals, rng, effort, step), rng, effort, step)

    def _search(
        self, space: JointSpace, q: Array, goals: Array, rng: np.random.Generator, effort: Effort, step: float
    ) -> Array:
        c, n = self._options, len(q)
        goals = goals[space.verdicts(goals) == 0]
        moving = (np.abs(goals - q) > STILL).any(axis=0)
        nodes = np.empty((2, NODES, n))
        parents = np.full((2, NODES), -1, np.int64)
        size = np.array([1, len(goals)])
        nodes[0, 0], nodes[1, : len(goals)] = q, goals
        # What takes longer counts as farther.
        weight = np.where(moving, 1.0 / self.speed, 0.0)
        checks = np.zeros(1, np.int64)
        while effort.left > 0 and size.max() < NODES:
            samples = np.where(moving, rng.uniform(space.space.lower, space.space.upper, (BATCH, n)), q)
            checks[0] = 0
            met = plan_kernel.grow(samples, nodes, parents, size, c.reach, step, weight, space.space, checks)
            effort.spend(int(checks[0]))
            if met:
                one, other = (_branch(nodes[k], parents[k], int(size[k]) - 1) for k in (0, 1))
                return np.concatenate([one[::-1], other[1:]])
        raise PlanRefused(
            Refusal.NO_PATH,
            f"No path was found within {effort.used} postures and {int(size.sum())} nodes; move the goal, or allow "
            "more effort.",
        )

    def _shortened(
        self, space: JointSpace, path: Array, rng: np.random.Generator, effort: Effort, step: float
    ) -> Array:
        """Return the path with corners cut off where two of its points can be joined by a straight line."""
        for _ in range(self._options.shortcuts):
            if len(path) <= 2 or effort.left <= 0:
                break
            at = np.concatenate(([0.0], np.cumsum((np.abs(np.diff(path, axis=0)) / self.speed).max(axis=1))))
            s, t = np.sort(rng.uniform(0.0, at[-1], 2))
            i, j = (min(int(np.searchsorted(at, x, side="right")) - 1, len(path) - 2) for x in (s, t))
            if i == j:
                continue
            a, b = (path[k] + (path[k + 1] - path[k]) * (x - at[k]) / (at[k + 1] - at[k]) for k, x in ((i, s), (j, t)))
            effort.spend(int(np.abs(b - a).max() / step) + 1)
            if space.free_line(a, b, step):
                path = _without_repeats(np.concatenate([path[: i + 1], [a, b], path[j + 1 :]]))
        return path


def _branch(nodes: Array, parents: Array, leaf: int) -> Array:
    """Return (k, n) the nodes from a leaf to its root."""
    rows = [leaf]
    while parents[rows[-1]] >= 0:
        rows.append(int(parents[rows[-1]]))
    return nodes[rows]


def _without_repeats(path: Array) -> Array:
    apart = np.abs(np.diff(path, axis=0)).max(axis=1) > STILL
    apart[-1] = True  # the goal itself stays, not a point by it
    kept = path[np.r_[True, apart]]
    if len(kept) > 2 and np.abs(kept[-1] - kept[-2]).max() <= STILL:
        kept = np.delete(kept, -2, axis=0)
    return kept
