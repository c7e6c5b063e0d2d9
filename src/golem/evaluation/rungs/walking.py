"""Rungs `walk-twist`, `walk-stop`, `walk-endurance` and `walk-rough`: how well a lower body walks."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from golem.capabilities.legs.base import Envelope
from golem.errors import check_known
from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, Loss
from golem.evaluation.episodes.oracle import errors
from golem.evaluation.episodes.scripted_motion import ArmMotion, ScriptedMotion
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions, can_walk, judged, no_walker
from golem.provenance import stack_facts
from golem.robots.mujoco.shoves import DIRECTIONS, shove
from golem.runtime.executor import when_stepped
from golem.skills.walk import WalkGoal
from golem.stack import Stack
from golem.types import PlanarPose, Twist

AHEAD = Twist(vx=0.4)
"""The twist."""
SECONDS = 10.0
"""Time it is commanded [s]: ramp, step and tiles begin a metre ahead and end after three more."""
STOP = 3.0
"""Time of standing after it [s]."""
GROUNDS: dict[str, Mapping[str, object]] = {
    "slope": {"world": "slope"},
    "slope-8": {"world": "slope", "slope": math.radians(8.0)},
    "rubble": {"world": "rubble"},
    "rubble-5": {"world": "rubble", "rubble": 0.05},
    "step-5": {"world": "step", "step": 0.05},
    "slippery": {"friction": 0.2},
    "load-5": {"payload": (5.0, 5.0)},
}
"""Options of the twin by name. A ramp of 5 or 8 degrees; tiles of up to 3 or 5 cm; a step of 5 cm up, and down again;
friction 0.2; 5 kg in each hand."""


@dataclass(frozen=True)
class WalkRoughOptions(PlantOptions):
    """The grounds."""

    ground: tuple[str, ...] = tuple(GROUNDS)
    """slope, slope-8 (degrees), rubble, rubble-5, step-5 (cm), slippery (friction 0.2), load-5 (kg in each hand)."""
    arms: bool = False
    """Whether the hands move through their work area meanwhile."""


class WalkRough(LegRung[WalkRoughOptions]):
    """Walk ahead on a slope, tiles, a step or slippery ground, or with loaded hands, and stop."""

    name = "walk-rough"
    varied = {"ground": "ground"}
    Options = WalkRoughOptions
    default_n = 20
    default_profile = "bench"
    walks = True

    def __init__(self, options: WalkRoughOptions | None = None) -> None:
        super().__init__(options)
        check_known("ground", GROUNDS, *self.options.ground)

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        grounds = self.options.ground
        return {g: stack_facts(self.stack(method, profile, overrides, GROUNDS[g])) for g in grounds}

    def trial_stack(self, spec: TrialSpec) -> Stack:
        return self.stack(spec.method, spec.profile, spec.overrides, GROUNDS[str(spec.case["ground"])])

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        motion = ScriptedMotion(ArmMotion(spec.rng("arms")) if self.options.arms else None)
        episode.start(motion)
        episode.stand(SETTLE)
        start = episode.t
        motion.twist = lambda t: AHEAD
        episode.run(SECONDS)
        motion.twist, end = None, episode.t
        episode.run(STOP)
        if episode.loss is not None:
            return judged(spec.method, episode.loss, {})
        path = episode.recorder.trace().window(start, end).base
        climbed, moved = path[-1, 2] - path[0, 2], np.hypot(*(path[-1] - path[0])[:2])
        return judged(spec.method, None, {"distance": float(moved), "climbed": float(climbed)})


MINUTE = 60.0
"""Length of one trial [s]."""
PATIENCE = 4.0
"""Time after its last push that has to be survived, too [s]."""


@dataclass(frozen=True)
class EnduranceOptions(PlantOptions):
    """The pushes."""

    shove: float = 30.0
    """Largest push [N s]."""


class WalkEndurance(LegRung[EnduranceOptions]):
    """Walk at random for a minute, arms moving, shoved with up to 30 N s every 4 to 8 seconds.

    Legs that take a height get one with each twist; those that only stand, heights alone.
    """

    name = "walk-endurance"
    Options = EnduranceOptions
    default_profile = "bench"

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        envelope = episode.running.envelope
        if not can_walk(envelope) and envelope.height is None:
            return no_walker(spec.method)
        shoves, script = spec.rng("shoves"), _script(envelope, spec.rng("twists"), spec.rng("heights"))
        motion = ScriptedMotion(ArmMotion(spec.rng("arms")))
        episode.start(motion)
        episode.stand(SETTLE)
        start = episode.t
        # The motion counts from its own begin.
        motion.twist = lambda t: [twist for at, twist in script if at <= episode.t - start][-1]
        count = 0
        while episode.t < start + MINUTE - 1e-6 and not episode.over:
            episode.run(min(shoves.uniform(4.0, 8.0), start + MINUTE - episode.t))
            if episode.t < start + MINUTE - 1e-6 and not episode.over:
                episode.push(shove(DIRECTIONS[shoves.integers(8)], shoves.uniform(0.0, self.options.shove)))
                count += 1
        series = {"seconds": episode.t - start, "pushes": float(count)}
        episode.run(PATIENCE)
        return judged(spec.method, episode.loss, series)


def _script(envelope: Envelope, rng: np.random.Generator, heights: np.random.Generator) -> list[tuple[float, Twist]]:
    """Return times [s] and the twist from each on; one in five stands still."""
    script = [(0.0, Twist())]
    while script[-1][0] < MINUTE:
        still = rng.random() < 0.2
        at = script[-1][0] + rng.uniform(3.0, 6.0)
        twist = random_twist(envelope, rng)
        twist = Twist() if still else twist
        if envelope.height is not None:
            twist = replace(twist, height=float(heights.uniform(envelope.height[0], envelope.height[2])))
        script.append((at, twist))
    return script


GOAL_DISTANCE = (1.8, 2.2)
"""Distance of the goals [m]."""
GOAL_TURN = 0.6
"""Largest turn to the final heading of a goal [rad]."""
TIMEOUT = 40.0
"""Time to stop at a goal [s]."""
AFTER = 1.0
"""Time after the skill's end until the pose is judged [s]."""


class WalkStop(LegRung[PlantOptions]):
    """Walk to a pose 2 m away and stand there, by the base estimator with 1 cm and 1 degree of noise."""

    name = "walk-stop"
    walks = True

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        goal = draw(spec.rng("goal"))
        episode.locate(spec.rng("odometry"))
        episode.stand(SETTLE)
        if episode.loss is not None:
            return judged(spec.method, episode.loss, {})
        episode.start("walk", WalkGoal(goal.x, goal.y, goal.yaw, "odom", TIMEOUT))
        episode.run(TIMEOUT + 1.0, until=lambda: episode.result is not None, due=when_stepped)
        episode.run(AFTER)
        result, loss = episode.result, episode.loss
        if loss is not None or result is None:
            return judged(spec.method, loss or Loss("walk", "The skill did not end."), {})
        series = errors("goal", goal.to(episode.robot.truth.pose()))
        loss = None if result.success else Loss(result.stage, result.reason, result.trace)
        return judged(spec.method, loss, series, result.timings)


def draw(rng: np.random.Generator) -> PlanarPose:
    """Return the goal of a trial."""
    bearing, distance = rng.uniform(-math.pi, math.pi), rng.uniform(*GOAL_DISTANCE)
    return PlanarPose(distance * math.cos(bearing), distance * math.sin(bearing), rng.uniform(-GOAL_TURN, GOAL_TURN))


SETTLE = 3.0
"""Time of standing before the twist [s]."""
COMMAND, COUNTED = 7.0, 4.0
"""How long one twist is commanded, and the last part of it that is counted [s]: whole gait cycles, nearly."""


class WalkTwist(LegRung[PlantOptions]):
    """Walk with one twist of the declared envelope per trial, its 26 ends, edges and corners first."""

    name = "walk-twist"
    default_profile = "bench"
    walks = True

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        twist = command(episode.running.envelope, spec.rng("twist"), spec.index)
        episode.stand(SETTLE)
        episode.start(ScriptedMotion(twist=lambda t: twist))
        episode.run(COMMAND)
        if episode.loss is not None:
            return judged(spec.method, episode.loss, {})
        walked = episode.recorder.trace().window(episode.t - COUNTED)
        error = np.abs(walked.twist.mean(axis=0) - [twist.vx, twist.vy, twist.wz])
        series = dict(zip(("error_vx", "error_vy", "error_wz"), error.tolist(), strict=True))
        return judged(spec.method, None, {**series, "error_speed": float(np.hypot(error[0], error[1]))})


def command(envelope: Envelope, rng: np.random.Generator, index: int) -> Twist:
    """Return the twist of trial `index`: the 26 ends, edges and corners of the envelope, then draws."""
    axes = [(low, 0.0, high) for low, high in (envelope.vx, envelope.vy, envelope.wz)]
    corners = [c for c in dict.fromkeys(itertools.product(*axes)) if any(c)]
    corners.sort(key=np.count_nonzero)  # first along one axis: who asks for few trials shall see each
    return Twist(*corners[index]) if index < len(corners) else random_twist(envelope, rng)


def random_twist(envelope: Envelope, rng: np.random.Generator) -> Twist:
    """Return a twist drawn from all of the envelope."""
    return Twist(*(float(rng.uniform(low, high)) for low, high in (envelope.vx, envelope.vy, envelope.wz)))
