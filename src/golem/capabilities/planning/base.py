"""The contract of a planner: where the arms are and where they shall be in, a timed trajectory of their joints out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from golem.errors import GolemError
from golem.types import UPPER, Array, Side

if TYPE_CHECKING:
    # Numba takes a second to import, and a stack that plans nothing does without it.
    from golem.capabilities.collision.obstacles import World
    from golem.capabilities.planning.rules import Rule

NUM_JOINTS = UPPER.stop - UPPER.start
"""Joints that are planned for: torso, left arm (7), right arm (7)."""


STRONGEST = 8.0
"""Acceleration that no joint of a plan exceeds [rad/s^2] [own: twice the limit that `rrt_connect` has by default]."""


class Refusal(StrEnum):
    """Why there is no plan."""

    BAD_INPUT = "bad_input"
    """A shape is wrong or a number is not finite."""
    START = "start"
    """The arms are where they may not be."""
    GOAL = "goal"
    """No goal may be gone to."""
    NO_PATH = "no_path"
    """None was found with the effort that was allowed."""
    NO_TIME = "no_time"
    """No effort was allowed."""
    STOPPED = "stopped"
    """The caller gave up."""
    UNREACHABLE = "unreachable"
    """No posture of the arm puts the hand there."""
    OFF_LINE = "off_line"
    """The hand cannot keep to the straight line."""


class PlanRefused(GolemError):
    """There is no plan; nothing has moved. Why, in a word, is its `refusal`."""

    def __init__(self, refusal: Refusal, reason: str) -> None:
        """Say why there is none, in a word and in a sentence."""
        super().__init__(refusal, reason)
        self.refusal = refusal

    def __str__(self) -> str:
        return str(self.args[1])


def _never() -> bool:
    return False


@dataclass(frozen=True, slots=True)
class Held:
    """Something a hand holds.

    Attributes:
        side: which hand.
        balls: (k, 4) what covers it: centres in the grasp frame and radii [m].
    """

    side: Side
    balls: Array


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """What is asked of a planner.

    Attributes:
        q: (15,) where the joints of torso and arms are [rad].
        goals: (k, 15) where they may go; any of them will do. Joints that are the same in `q` and in every goal do
            not move on the way.
        world: what stands around, in base_link.
        rules: what the way has to keep besides; see `golem.capabilities.planning.rules`.
        held: what the hands hold.
        speed: share of the planner's speed limits that may be used, in (0, 1].
        hand_speed: how fast the hands may move [m/s].
        effort: postures that may be looked at; about 100,000 take a second.
        seed: of whatever is drawn.
        stop: asked now and then; True gives the search up.
    """

    q: Array
    goals: Array
    world: World | None = None
    rules: Sequence[Rule] = ()
    held: Sequence[Held] = ()
    speed: float = 1.0
    hand_speed: float = 0.5
    effort: int = 100_000
    seed: int = 0
    stop: Callable[[], bool] = _never


@dataclass(frozen=True, slots=True)
class Plan:
    """A timed trajectory, at rest at both ends. Between two points it is the cubic Hermite polynomial.

    Attributes:
        times: (n,) times of its points after its beginning [s], from zero, increasing; at least two.
        q: (n, 15) joints there [rad]; the first is where the arms are.
        dq: (n, 15) their velocities [rad/s].
        corners: (m, 15) the path as it was found, before its corners were rounded [rad].
        checks: postures that were looked at.
    """

    times: Array
    q: Array
    dq: Array
    corners: Array
    checks: int


@runtime_checkable
class ArmPlanner(Protocol):
    """Finds a way for torso and arms that touches nothing, and times it.

    It is passive and deterministic: the same request gets the same answer. The trajectory keeps the range that the
    safety gate allows, the planner's limits of speed and acceleration, at most `STRONGEST`, and of the request the
    share of speed, the speed of the hands, and every rule.

    Attributes:
        latency: time that a plan takes [s], as the lock-step runner shall account for it.
    """

    latency: float

    def plan(self, request: PlanRequest) -> Plan:
        """Return a trajectory from `request.q` to one of `request.goals`. Raises PlanRefused: there is none."""
        ...


def check_request(request: PlanRequest) -> tuple[Array, Array]:
    """Return `q` (15,) and `goals` (k, 15) of a request as arrays of float64.

    Raises PlanRefused: a shape is wrong, a number is not finite, or a bound has no meaning.
    """
    q, goals = np.asarray(request.q, np.float64), np.asarray(request.goals, np.float64)
    if q.shape != (NUM_JOINTS,):
        raise _bad(f"q has shape {q.shape}; a plan begins at ({NUM_JOINTS},) joints of torso and arms.")
    if goals.ndim == 1:
        goals = goals[None]
    if goals.ndim != 2 or goals.shape[1] != NUM_JOINTS or not len(goals):
        raise _bad(f"goals has shape {goals.shape}; a plan ends at one of (k, {NUM_JOINTS}) joints.")
    if not (np.isfinite(q).all() and np.isfinite(goals).all()):
        raise _bad("q or goals contain NaN or infinity; give the joints in radians.")
    if not (0.0 < request.speed <= 1.0 and request.hand_speed > 0.0):
        raise _bad("The speed of a plan is a share in (0, 1], and its hand_speed positive.")
    if request.effort < 1:
        raise PlanRefused(Refusal.NO_TIME, "No effort is left to plan with; allow one posture at least.")
    return q, goals


def _bad(reason: str) -> PlanRefused:
    return PlanRefused(Refusal.BAD_INPUT, reason)
