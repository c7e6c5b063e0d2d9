"""Recorded walks for judging base estimators: what the sensors said and what was true, and ways to spoil the former."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from golem.evaluation.base import TrialSpec
from golem.evaluation.episodes.episode import Episode
from golem.evaluation.episodes.scripted_motion import ArmMotion, ScriptedMotion
from golem.interfaces import topics
from golem.robots.model.leg_dynamics import LEG, LegDynamics
from golem.robots.mujoco.shoves import DIRECTIONS, shove
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
    """Let a robot walk, its arms moving, record and close it.

    Args:
        episode: the robot.
        spec: the draws.
        pushed: with one shove per segment, all directions in turn.
    """
    truth = episode.robot.truth
    T_odom_world = np.linalg.inv(truth.T_world_odom)
    states: list[LowState] = []
    poses, velocities, forces, stepping, free = [], [], [], [], []

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
        for column, value in zip((poses, velocities, forces), now, strict=True):
            column.append(value)
        stepping.append(legs is not None and (legs.stepping or legs.moving))
        free.append(not episode.robot.on_gantry)
        now = look()
        return False

    try:
        episode.start(ScriptedMotion(ArmMotion(spec.rng("arms")), twist_at))
        episode.run(START, sample)
        for i in range(len(TWISTS) + 1):
            episode.run(0.5, sample)
            if pushed and not episode.over:
                episode.push(shove(DIRECTIONS[(i + spec.index) % len(DIRECTIONS)], SHOVE))
            episode.run(SEGMENT - 0.5, sample)
        loss = episode.loss
    finally:
        episode.close()
    judged = np.cumsum(free) * TICK > 1.0
    if loss is not None:
        judged[-round(1.0 / TICK) :] = False
    return RecordedWalk(
        states=states,
        T=np.array(poses),
        velocity=np.array(velocities),
        forces=np.array(forces),
        judged=judged,
        stepping=np.array(stepping),
        lost="" if loss is None else loss.detail,
    )


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
        speed = np.where(
            (walk.forces[i] > LOADED)[:, None],
            np.array([np.linalg.lstsq(J, slide, rcond=1e-3)[0] for J in legs.jacobians]),
            -offset / RETURN,
        )
        offset = offset + speed * TICK
        q, dq = state.q.copy(), state.dq.copy()
        q[LEGS] += offset.ravel()
        dq[LEGS] += speed.ravel()
        out.append(replace(state, q=q, dq=dq))
    return out


SPOILS: dict[str, Spoil] = {
    "nominal": nothing,
    "wrong contacts": wrong_contacts,
    "10 % slip": slipping,
}
"""How the recorded sensors are spoilt, by name."""
