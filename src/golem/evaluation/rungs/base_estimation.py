"""Rung `base-estimation`: base estimators on the same recorded walks, against the simulator's truth."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem import registry
from golem.errors import ConfigError, GolemError
from golem.evaluation.base import DONE, Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, episode_seed, legs_stack
from golem.evaluation.episodes.scripted_motion import ArmMotion, ScriptedMotion
from golem.hardware.estimator.base import BaseEstimator
from golem.interfaces import topics
from golem.provenance import stack_facts
from golem.robots.model.leg_kernel import LEG, LegDynamics
from golem.robots.mujoco.shoves import DIRECTIONS, shove
from golem.runtime.contract_check import ContractCheck
from golem.stack import Choice
from golem.true_runs import true_runs
from golem.types import LEGS, TICK, Array, LowState, Twist

START = 5.0
"""Time the robot stands before it walks [s]: the band goes, and what estimators learn at rest is learned."""
SEGMENT = 4.0
"""Duration of each twist [s]."""
TWISTS = (
    Twist(0.6, 0.0, 0.0),
    Twist(0.4, 0.0, 0.4),
    Twist(0.0, 0.25, 0.0),
    Twist(-0.3, 0.0, 0.0),
    Twist(0.0, 0.0, 0.5),
    Twist(0.3, -0.2, -0.3),
)
"""What is walked, one segment after the other; the robot stands before and after."""
SHOVE = 20.0
"""Impulse of the shoves of a pushed walk [N s], one per segment, half a second into it."""
LOADED = 100.0
"""Force above which a foot truly carries load [N]."""
WRONG_RATE, WRONG_TIME = 1.0, 0.15
"""How often a foot's contact is made wrong [1/s], and for how long [s]."""
SLIP = 0.1
"""How far a planted foot slides back, as a share of the way of the base."""
RETURN = 0.05
"""Time constant with which a foot that has slid comes back in the air [s]."""


@dataclass(frozen=True, slots=True)
class RecordedWalk:
    """One recorded episode, n samples.

    Attributes:
        states: what the sensors said.
        T: (n, 4, 4) true pose of base_link in odom.
        velocity: (n, 3) its true velocity in odom [m/s].
        forces: (n, 2) true vertical force on each foot [N].
        judged: (n,) whether the band is gone, the filters have had a second, and the robot does not fall within one.
        stepping: (n,) whether the robot walked or stepped.
        lost: how the robot was lost, empty if it was not.
    """

    states: list[LowState]
    T: Array
    velocity: Array
    forces: Array
    judged: NDArray[np.bool_]
    stepping: NDArray[np.bool_]
    lost: str


def twist_at(t: float) -> Twist:
    """Return what is commanded at time `t` [s]."""
    segment = int((t - START) // SEGMENT)
    return TWISTS[segment] if 0 <= segment < len(TWISTS) else Twist()


def record(episode: Episode, spec: TrialSpec, pushed: bool) -> RecordedWalk:
    """Let a robot walk, arms moving, record and close it; `pushed` is with one shove per segment, from all sides."""
    truth = episode.robot.truth
    T_odom_world = np.linalg.inv(truth.T_world_odom)
    states, rows = list[LowState](), list[tuple[Array, Array, Array, bool, bool]]()

    def look() -> tuple[Array, Array, Array]:
        base = truth.base()
        velocity = T_odom_world[:3, :3] @ base.velocity
        return T_odom_world @ base.T_world_base, velocity, truth.foot_forces()[:, 2]

    # Sensors are read at the beginning of a tick: what was true at the end of the one before belongs to them.
    now = look()

    def sample() -> bool:
        nonlocal now
        state = episode.running.bus.latest(topics.LOW_STATE)
        legs = episode.running.bus.latest(topics.LEG_STATUS)
        if state is None or (states and state.t == states[-1].t):
            return False  # asked before the first tick of a stretch
        states.append(state)
        rows.append((*now, legs is not None and (legs.stepping or legs.moving), not episode.robot.on_gantry))
        now = look()
        return False

    with closing(episode):
        episode.start(ScriptedMotion(ArmMotion(spec.rng("arms")), twist_at))
        episode.run(START, sample)
        for i in range(len(TWISTS) + 1):
            episode.run(0.5, sample)
            if pushed and not episode.over:
                episode.push(shove(DIRECTIONS[(i + spec.index) % len(DIRECTIONS)], SHOVE))
            episode.run(SEGMENT - 0.5, sample)
        loss = episode.loss
    T, velocity, forces, stepping, free = (np.array([row[i] for row in rows]) for i in range(5))
    judged = np.cumsum(free) * TICK > 1.0
    if loss is not None:
        judged[-round(1.0 / TICK) :] = False
    return RecordedWalk(states, T, velocity, forces, judged, stepping, "" if loss is None else loss.detail)


Spoil = Callable[[RecordedWalk, np.random.Generator], list[LowState]]


def nothing(walk: RecordedWalk, rng: np.random.Generator) -> list[LowState]:
    """Return what the sensors said."""
    return walk.states


def wrong_contacts(walk: RecordedWalk, rng: np.random.Generator) -> list[LowState]:
    """Return states whose torques tell of contacts that are not there, and hide others.

    Each foot, `WRONG_RATE` times a second and for `WRONG_TIME`: one in the air seems to carry 400 N, one that carries
    load seems to hang.
    """
    n = len(walk.states)
    begins = rng.random((n, 2)) < WRONG_RATE * TICK
    length = round(WRONG_TIME / TICK)
    wrong = np.array([begins[max(0, i - length + 1) : i + 1].any(axis=0) for i in range(n)])
    legs, out = LegDynamics(), list(walk.states)
    for i in np.flatnonzero(wrong.any(axis=1)):
        state = walk.states[i]
        legs.update(state.q[LEGS], state.dq[LEGS])
        up, tau = walk.T[i, 2, :3], state.tau.copy()
        for k in np.flatnonzero(wrong[i]):
            force = -1500.0 if walk.forces[i, k] > LOADED else 400.0
            tau[LEG * k : LEG * (k + 1)] -= legs.jacobians[k, :3].T @ (force * up)
        out[i] = replace(state, tau=tau)
    return out


def slipping(walk: RecordedWalk, rng: np.random.Generator) -> list[LowState]:
    """Return states of a robot each of whose planted feet slides back by `SLIP` of the way the base goes.

    The base moves as recorded, so the joints must have moved further: each leg gets the joint motion that slides its
    sole, and loses it again while it swings.
    """
    legs, out = LegDynamics(), list[LowState]()
    offset = np.zeros((2, LEG))
    for i, state in enumerate(walk.states):
        legs.update(state.q[LEGS], state.dq[LEGS])
        slide = np.zeros(6)
        slide[:3] = walk.T[i, :3, :3].T @ (-SLIP * walk.velocity[i] * (1.0, 1.0, 0.0))
        sliding = np.array([np.linalg.lstsq(J, slide, rcond=1e-3)[0] for J in legs.jacobians])
        speed = np.where((walk.forces[i] > LOADED)[:, None], sliding, -offset / RETURN)
        offset = offset + speed * TICK
        q, dq = state.q.copy(), state.dq.copy()
        q[LEGS] += offset.ravel()
        dq[LEGS] += speed.ravel()
        out.append(replace(state, q=q, dq=dq))
    return out


SPOILS: dict[str, Spoil] = {"nominal": nothing, "wrong contacts": wrong_contacts, "10 % slip": slipping}
"""How the recorded sensors are spoilt, by name."""


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
    varied = {"condition": (*SPOILS, PUSHED)}
    Options = BaseEstimationOptions
    default_methods = ("random_walk_kf", "invariant_ekf")
    default_n = 3

    def methods(self) -> tuple[str, ...]:
        """Return the registered estimators of a robot on its feet."""
        return tuple(name for name in registry.names(SLOT) if name != "tether")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        walking = legs_stack(self.options.legs, profile, overrides)
        registry.load(SLOT, _choice(method).use)
        return {**stack_facts(walking), "method": stack_facts(walking.with_choice(SLOT, method))["user_files"]}

    def together(self, spec: TrialSpec) -> Hashable:
        return spec.index, spec.case["condition"] == PUSHED

    def run_together(self, specs: Sequence[TrialSpec]) -> Sequence[TrialOutcome]:
        spec = specs[0]
        stack = legs_stack(self.options.legs, spec.profile, spec.overrides)
        episode = Episode(stack, episode_seed(spec.seed, spec.index), self.onlooker)
        walk = record(episode, spec, pushed=spec.case["condition"] == PUSHED)
        if not walk.judged.any():
            raise GolemError(f"{self.options.legs} did not stand for a second: {walk.lost or 'it hung in its band'}")
        return [follow(spec, walk) for spec in specs]


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
        "gap": int(np.max(np.diff(true_runs(stale[judged])), initial=0)) * TICK,
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
        return TrialOutcome(True, DONE, detail=f"velocity off by {error:.3f} m/s{lost}", series=series, costs=costs)
    detail = f"The velocity is off by {error:.3f} m/s, more than {TOLERANCE:g}{lost}."
    return TrialOutcome(False, "velocity", f"{SLOT}: {spec.method}", detail, series=series, costs=costs)


def _estimates(method: str, states: Sequence[LowState]) -> tuple[Array, Array, Array, Array]:
    """Return pose (n, 4, 4), velocity (n, 3), whether it was stale (n,) and CPU time (n,) [s] of every tick."""
    choice, n = _choice(method), len(states)
    contract = ContractCheck(SLOT, choice.use)
    estimator = _impatient(choice)
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


def _impatient(choice: Choice) -> BaseEstimator:
    """Return a new estimator that calls itself stale at once, where it has that option."""
    with suppress(ConfigError):
        return registry.create(SLOT, choice.use, {**choice.options, "stale_after": 0.0})
    return registry.create(SLOT, choice.use, choice.options)


def _way(T: Array, first: int, last: int) -> Array:
    """Return x, y [m] and heading [rad] (3,) of pose `last` in the heading frame of pose `first`, T (n, 4, 4)."""
    yaw = np.arctan2(T[[first, last], 1, 0], T[[first, last], 0, 0])
    c, s = math.cos(yaw[0]), math.sin(yaw[0])
    x, y = T[last, :2, 3] - T[first, :2, 3]
    return np.array([c * x + s * y, c * y - s * x, yaw[1] - yaw[0]])
