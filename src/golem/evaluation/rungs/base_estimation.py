"""Rung `base-estimation`: base estimators on the same recorded walks, against the simulator's truth."""

from __future__ import annotations

import math
import time
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from golem import registry
from golem.errors import ConfigError, GolemError
from golem.evaluation.base import DONE, Case, Results, Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, episode_seed, legs_stack
from golem.evaluation.episodes.walk_dataset import SPOILS, RecordedWalk, nothing, record
from golem.hardware.estimator.base import BaseEstimator
from golem.provenance import stack_facts
from golem.runtime.contract_check import ContractCheck
from golem.stack import Choice
from golem.true_runs import true_runs
from golem.types import TICK, Array, LowState

SLOT = "estimator"
"""What the methods of this rung are."""
PUSHED = "pushed"
"""The condition with shoves and unspoilt sensors."""
MIN_DISTANCE = 1.0
"""Distance from which on an error at the end counts as a drift [m]."""
TOLERANCE = 0.05
"""Error of the velocity up to which legs can go by it, RMS of the vector while walking [m/s]."""


@dataclass(frozen=True)
class BaseEstimationOptions:
    """The walks."""

    legs: str = "almi"
    """The lower body that walks."""


class BaseEstimation(Rung[BaseEstimationOptions]):
    """Estimate the base of a robot that walks 33 s: velocity, drift and heading, with good and with spoilt sensors.

    Every estimator reads the same recorded walks: sensors as they are, with contacts made wrong, with feet that slip,
    and of walks with pushes.
    """

    name = "base-estimation"
    Options = BaseEstimationOptions
    default_methods = ("random_walk_kf", "invariant_ekf")
    default_n = 3

    def methods(self) -> tuple[str, ...]:
        """Return the registered estimators of a robot on its feet."""
        return tuple(name for name in registry.names(SLOT) if name != "tether")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        walking = legs_stack(self.options.legs, profile, overrides)
        registry.load(SLOT, _choice(method).use)
        return {
            **stack_facts(walking),
            "method": stack_facts(walking.with_choice(SLOT, method))["user_files"],
        }

    def cases(self, results: Results) -> Sequence[Case]:
        """Return what the sensors suffer."""
        return [{"condition": name} for name in (*SPOILS, PUSHED)]

    def together(self, spec: TrialSpec) -> Hashable:
        """Return what trials share that read the same recording."""
        return spec.index, spec.case["condition"] == PUSHED

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial; see `Rung`."""
        return self.run_together([spec])[0]

    def run_together(self, specs: Sequence[TrialSpec]) -> Sequence[TrialOutcome]:
        """Record one walk, and let estimators follow it."""
        spec = specs[0]
        walk = self._record(spec)
        if not walk.judged.any():
            raise GolemError(
                f"{self.options.legs} did not stand for a second: {walk.lost or 'it hung in its band'}"
            )
        return [follow(spec, walk) for spec in specs]

    def _record(self, spec: TrialSpec) -> RecordedWalk:
        stack = legs_stack(self.options.legs, spec.profile, spec.overrides)
        episode = Episode(stack, episode_seed(spec.seed, spec.index), self.onlooker)
        return record(episode, spec, pushed=spec.case["condition"] == PUSHED)


def follow(spec: TrialSpec, walk: RecordedWalk) -> TrialOutcome:
    """Let a new estimator follow a walk whose sensors suffer what the trial says, and compare it with what was true."""
    condition = str(spec.case["condition"])
    states = SPOILS.get(condition, nothing)(walk, spec.rng(condition))
    T, velocity, stale, ticks = _estimates(spec.method, states)
    judged = np.flatnonzero(walk.judged)
    first, last = judged[0], judged[-1]
    squares = ((velocity - walk.velocity) ** 2).sum(axis=1)
    # The way since the first judged sample, each in the heading frame it had then.
    way, true = (_way(poses, first, last) for poses in (T, walk.T))
    # Sampled once a second: the sway of walking is no way.
    steps = np.linalg.norm(np.diff(walk.T[first : last + 1 : round(1.0 / TICK), :2, 3], axis=0), axis=1)
    distance = float(steps.sum())
    series = {
        "yaw_drift": math.remainder(way[2] - true[2], 2.0 * math.pi),
        "gap": _longest(stale[judged]) * TICK,
        "distance": distance,
    }
    for name, chosen in (("velocity_standing", ~walk.stepping), ("velocity_walking", walk.stepping)):
        part = squares[walk.judged & chosen]
        if len(part):
            series[name] = math.sqrt(part.mean())
    if distance >= MIN_DISTANCE:
        series["drift"] = float(np.hypot(*(way - true)[:2])) / distance
    costs = {"tick": float(np.median(ticks)), "tick_p99": float(np.quantile(ticks, 0.99))}
    error = series.get("velocity_walking", series.get("velocity_standing", 0.0))
    lost = f"; the walk ended early: {walk.lost}" if walk.lost else ""
    if error <= TOLERANCE:
        return TrialOutcome(
            True, DONE, detail=f"velocity off by {error:.3f} m/s{lost}", series=series, costs=costs
        )
    detail = f"The velocity is off by {error:.3f} m/s, more than {TOLERANCE:g}{lost}."
    return TrialOutcome(False, "velocity", f"{SLOT}: {spec.method}", detail, series=series, costs=costs)


def _estimates(method: str, states: Sequence[LowState]) -> tuple[Array, Array, Array, Array]:
    """Return pose (n, 4, 4), velocity (n, 3), whether it was stale (n,) and CPU time (n,) [s] of every tick."""
    choice, n = _choice(method), len(states)
    contract = ContractCheck(SLOT, choice.use)
    estimator: BaseEstimator = registry.create(SLOT, choice.use, {**choice.options, **_impatient(choice.use)})
    contract.call(estimator.reset, states[0])
    T, velocity, stale, ticks = np.empty((n, 4, 4)), np.empty((n, 3)), np.empty(n, dtype=bool), np.empty(n)
    for i, state in enumerate(states):
        start = time.thread_time_ns()
        estimate = contract.call(estimator.step, state, TICK)
        ticks[i] = (time.thread_time_ns() - start) * 1e-9
        T[i] = contract.array("T_odom_base", estimate.T_odom_base, 4, 4)
        velocity[i], stale[i] = contract.array("velocity", estimate.velocity, 3), estimate.stale
    return T, velocity, stale, ticks


def _choice(method: str) -> Choice:
    return legs_stack("almi", "ideal", {SLOT: method}).choice(SLOT)


def _impatient(use: str) -> dict[str, object]:
    """Return the option under which an estimator calls itself stale at once, where it has that option."""
    options: dict[str, object] = {"stale_after": 0.0}
    try:
        registry.create(SLOT, use, options)
    except ConfigError:
        return {}
    return options


def _way(T: Array, first: int, last: int) -> Array:
    """Return x, y [m] and heading [rad] (3,) of pose `last` in the heading frame of pose `first`, T (n, 4, 4)."""
    yaw = np.arctan2(T[[first, last], 1, 0], T[[first, last], 0, 0])
    c, s = math.cos(yaw[0]), math.sin(yaw[0])
    x, y = T[last, :2, 3] - T[first, :2, 3]
    return np.array([c * x + s * y, c * y - s * x, yaw[1] - yaw[0]])


def _longest(flags: Array) -> int:
    """Return the length of the longest run of true values."""
    return int(np.max(np.diff(true_runs(flags)), initial=0))
