"""Rung `walk-stop`: walk to a pose 2 m away and stand there, by the robot's own estimate."""

from __future__ import annotations

import math

import numpy as np

from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, Loss
from golem.evaluation.episodes.simulated_odometry import SimulatedOdometry
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions, judged
from golem.evaluation.rungs.walk_twist import SETTLE
from golem.runtime.executor import when_stepped
from golem.skills.walk import WalkGoal
from golem.types import PlanarPose

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
        """Run one trial; see `LegRung`."""
        goal, noise = draw(spec.rng("goal")), spec.rng("odometry")
        episode.locate(SimulatedOdometry(episode.running.bus, episode.robot, "estimator", noise))
        episode.stand(SETTLE)
        if episode.loss is not None:
            return judged(spec.method, episode.loss, {})
        episode.start("walk", WalkGoal(goal.x, goal.y, goal.yaw, "odom", TIMEOUT))
        episode.run(TIMEOUT + 1.0, until=lambda: episode.result is not None, due=when_stepped)
        episode.run(AFTER)
        result, loss = episode.result, episode.loss
        if loss is not None or result is None:
            return judged(spec.method, loss or Loss("walk", "The skill did not end."), {})
        left = goal.to(episode.robot.truth.pose())
        radial = math.hypot(left.x, left.y)
        series = {"goal_x": left.x, "goal_y": left.y, "goal_radial": radial, "goal_yaw": left.yaw}
        loss = None if result.success else Loss(result.stage, result.reason, result.trace)
        return judged(spec.method, loss, series, result.timings)


def draw(rng: np.random.Generator) -> PlanarPose:
    """Return the goal of a trial."""
    bearing, distance = rng.uniform(-math.pi, math.pi), rng.uniform(*GOAL_DISTANCE)
    return PlanarPose(distance * math.cos(bearing), distance * math.sin(bearing), rng.uniform(-GOAL_TURN, GOAL_TURN))
