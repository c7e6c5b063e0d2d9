"""`golem bench estimation`: base estimators on the same recorded walks, against the simulator's truth."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Annotated

import numpy as np
from rich.console import Console
from rich.table import Table
from tyro.conf import arg

from golem import registry
from golem.errors import ConfigError, GolemError
from golem.evaluation.episodes.walk_dataset import SPOILS, RecordedWalk, nothing, record
from golem.evaluation.subject import Subject
from golem.hardware.estimator.base import BaseEstimator
from golem.robots.sensors.profiles import load_profile
from golem.types import TICK, Array, LowState

ESTIMATORS = ("random_walk_kf", "invariant_ekf")
"""Estimators of a robot on its feet."""
LEAST_WAY = 1.0
"""Way from which on an error at its end is a drift [m]."""
PUSHED = "pushed"
"""The condition with shoves and unspoilt sensors."""


@dataclass(frozen=True)
class EstimationConfig:
    """Judge base estimators: velocity, drift and heading against the truth, and what a tick costs.

    Every estimator reads the same recorded walks: sensors as they are, with contacts made wrong, with feet that slip,
    and of walks with pushes.
    """

    estimator: tuple[str, ...] = ESTIMATORS
    """Estimators: registered names, file.py:Class or package.module:Class."""
    method: str = "almi"
    """The lower body that walks."""
    n: Annotated[int, arg(aliases=("-n",))] = 3
    """Walks of 33 s, each without and with pushes."""
    profile: str = "field"
    """Realism of the sensors: ideal, bench or field."""
    seed: int = 0
    """Seed of the walks."""
    json: bool = False
    """Print the figures as a last line of JSON."""


@dataclass(frozen=True, slots=True)
class EstimationRow:
    """One estimator under one condition.

    Attributes:
        estimator, condition: what was judged.
        standing, walking: root mean square of the velocity's error vector [m/s]; None where it never did.
        drift: horizontal error at the end over the distance walked, mean over the walks of at least `LEAST_WAY`; None
            without any.
        yaw: root mean square of the error of the heading's change at the end [rad].
        gap: longest time without a believed foot after the start [s].
        tick, tick_p99: CPU time of one tick, median and 99 % quantile [us].
        distance: walked in all [m].
    """

    estimator: str
    condition: str
    standing: float | None
    walking: float | None
    drift: float | None
    yaw: float
    gap: float
    tick: float
    tick_p99: float
    distance: float


@dataclass(frozen=True, slots=True)
class _Track:
    """What became of one estimator on one walk.

    Attributes:
        standing, walking: squared errors of the velocity [m^2/s^2].
        error: horizontal error at the end [m].
        distance: walked [m].
        yaw: error of the heading's change [rad].
        gap: longest time without a believed foot [s].
        ticks: CPU time of each tick [s].
    """

    standing: Array
    walking: Array
    error: float
    distance: float
    yaw: float
    gap: float
    ticks: Array


def run_estimation(config: EstimationConfig) -> list[EstimationRow]:
    """Record the walks, judge every estimator on them and print a table.

    Raises:
        GolemError: an option is wrong, or the lower body cannot run.
    """
    load_profile(config.profile)
    if config.n < 1 or not config.estimator:
        raise ConfigError("Give at least one --estimator and -n 1.")
    if config.seed < 0:
        raise ConfigError(f"--seed is {config.seed}; it must be 0 or more.")
    for use in config.estimator:
        registry.load("estimator", use)
    subject = Subject.of(config.method, config.profile, {})
    tracks: dict[tuple[str, str], list[_Track]] = {}
    lost = 0
    for index in range(config.n):
        spec = subject.draw(config.seed, index)
        for pushed in (False, True):
            walk = record(subject, spec, pushed)
            if not walk.judged.any():
                raise GolemError(
                    f"{config.method} did not stand for a second: {walk.lost or 'it hung in its band'}"
                )
            lost += bool(walk.lost)
            for condition, spoil in {PUSHED: nothing}.items() if pushed else SPOILS.items():
                states = spoil(walk, spec.rng(condition))
                for use in config.estimator:
                    tracks.setdefault((use, condition), []).append(_follow(use, walk, states))
    rows = [_row(use, condition, found) for (use, condition), found in tracks.items()]
    Console().print(
        _table(rows, f"{config.n} walks, profile {config.profile}, {lost} of {2 * config.n} lost")
    )
    if config.json:
        print(json.dumps([asdict(row) for row in rows]))
    return rows


def _follow(use: str, walk: RecordedWalk, states: Sequence[LowState]) -> _Track:
    """Run a new estimator `use` on `states` and compare it with what was true."""
    estimator: BaseEstimator = registry.create("estimator", use, _impatient(use))
    estimator.reset(states[0])
    n = len(states)
    T, velocity, stale, ticks = np.empty((n, 4, 4)), np.empty((n, 3)), np.empty(n, dtype=bool), np.empty(n)
    for i, state in enumerate(states):
        start = time.thread_time_ns()
        estimate = estimator.step(state, TICK)
        ticks[i] = (time.thread_time_ns() - start) * 1e-9
        T[i], velocity[i], stale[i] = estimate.T_odom_base, estimate.velocity, estimate.stale
    judged = np.flatnonzero(walk.judged)
    first, last = judged[0], judged[-1]
    squares = ((velocity - walk.velocity) ** 2).sum(axis=1)
    # The way since the first judged sample, each in the heading frame it had then.
    way, true = (_way(poses, first, last) for poses in (T, walk.T))
    # Sampled once a second: the sway of walking is no way.
    steps = np.linalg.norm(np.diff(walk.T[first : last + 1 : round(1.0 / TICK), :2, 3], axis=0), axis=1)
    return _Track(
        standing=squares[walk.judged & ~walk.stepping],
        walking=squares[walk.judged & walk.stepping],
        error=float(np.hypot(*(way - true)[:2])),
        distance=float(steps.sum()),
        yaw=math.remainder(way[2] - true[2], 2.0 * math.pi),
        gap=_longest(stale[judged]) * TICK,
        ticks=ticks,
    )


def _impatient(use: str) -> dict[str, object]:
    """Return the options under which an estimator calls itself stale at once, where it has that option."""
    options: dict[str, object] = {"stale_after": 0.0}
    try:
        registry.create("estimator", use, options)
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
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _row(use: str, condition: str, tracks: Sequence[_Track]) -> EstimationRow:
    def rms(parts: Sequence[Array]) -> float | None:
        squares = np.concatenate(parts)
        return math.sqrt(squares.mean()) if len(squares) else None

    drifts = [track.error / track.distance for track in tracks if track.distance >= LEAST_WAY]
    ticks = np.concatenate([track.ticks for track in tracks]) * 1e6
    return EstimationRow(
        estimator=use,
        condition=condition,
        standing=rms([track.standing for track in tracks]),
        walking=rms([track.walking for track in tracks]),
        drift=float(np.mean(drifts)) if drifts else None,
        yaw=math.sqrt(np.mean([track.yaw**2 for track in tracks])),
        gap=max(track.gap for track in tracks),
        tick=float(np.median(ticks)),
        tick_p99=float(np.quantile(ticks, 0.99)),
        distance=sum(track.distance for track in tracks),
    )


def _table(rows: Sequence[EstimationRow], title: str) -> Table:
    columns = ("standing m/s", "walking m/s", "drift m/m", "yaw deg", "longest gap ms", "tick us", "p99 us")
    table = Table("estimator", "condition", *columns, title=title)
    for row in rows:
        figures = (
            *("-" if rms is None else f"{rms:.4f}" for rms in (row.standing, row.walking)),
            "-" if row.drift is None else f"{row.drift:.4f}",
            f"{math.degrees(row.yaw):.2f}",
            f"{1e3 * row.gap:.0f}",
            f"{row.tick:.0f}",
            f"{row.tick_p99:.0f}",
        )
        table.add_row(row.estimator, row.condition, *figures)
    return table
