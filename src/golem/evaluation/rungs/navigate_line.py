"""Rung `navigate-line`: the paper's 6 m straight line over the open floor, by odometry; one lower body per method."""

from __future__ import annotations

import math
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from golem.evaluation.base import DONE, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, Loss
from golem.evaluation.episodes.last_seconds import FilmStrip
from golem.evaluation.rungs.leg_rung import NO_WALKER, LegRung, PlantOptions
from golem.interfaces import topics
from golem.robots.mujoco.balance import TRACE
from golem.runtime.executor import when_stepped
from golem.skills.walk import WalkGoal
from golem.types import PlanarPose

DISTANCE = 6.0
"""Length of the line [m], from the paper."""
TOLERANCE = 0.5
"""True radial error up to which the goal counts as reached [m]; the paper's failed run was several metres off."""
SETTLE = 2.0
"""Time before the robot sets out [s]."""
TIMEOUT = 60.0
"""Time it gets to arrive [s]."""
PICTURES = 5
"""Moments of the strip of pictures."""


@dataclass(frozen=True)
class LineOptions(PlantOptions):
    """The twin under the lower bodies."""

    latency: float = 0.0
    """Delay of motor commands on top of the profile's [s]."""


class NavigateLine(LegRung[LineOptions]):
    """Walk 6 m straight ahead over the open floor, by odometry; the error is that of the true pose.

    No LiDAR odometry takes part: the robot goes by its base estimator, to whose pose a noise of 1 cm and 1 deg is
    added (`golem.evaluation.episodes.episode`). The drift of legs and IMU over the line is in the error.
    """

    name = "navigate-line"
    Options = LineOptions
    facts = {"distance": DISTANCE, "tolerance": TOLERANCE}

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        with closing(self.episode(spec)) as episode:
            if episode.running.envelope.vx[1] <= 0.0:
                why = "It does not walk: the greatest forward speed in its envelope is zero."
                return TrialOutcome(False, NO_WALKER, f"lower_body: {spec.method}", why)
            episode.locate(spec.rng("odometry"))
            strip = FilmStrip(episode.robot, 0.0)
            episode.stand(SETTLE)
            if not episode.over:
                goal = WalkGoal(DISTANCE, 0.0, 0.0, "odom", TIMEOUT)
                episode.start("walk", goal)
            for _ in range(PICTURES - 1):
                strip.keep(episode.t, np.zeros(3))
                episode.run(DISTANCE / PICTURES / 0.4, until=lambda: episode.result is not None, due=when_stepped)
            episode.run(TIMEOUT, until=lambda: episode.result is not None, due=when_stepped)
            strip.keep(episode.t, np.zeros(3))
            if artefacts is not None:
                episode.recorder.trace().save(artefacts / TRACE)
            outcome = judge(episode, spec.method)
            shown = not outcome.success or spec.index == 0
            return replace(outcome, picture=strip.picture() if shown else None)


def judge(episode: Episode, method: str) -> TrialOutcome:
    """Say where the robot ended."""
    trace, true = episode.recorder.trace(), episode.robot.truth.pose()
    left = PlanarPose(DISTANCE, 0.0, 0.0).to(true)
    radial = math.hypot(left.x, left.y)
    series = {
        "goal_x": left.x,
        "goal_y": left.y,
        "goal_radial": radial,
        "goal_yaw": left.yaw,
        "steps": float(trace.steps),
        "margin_min": float(trace.margin.min()),
    }
    believed = episode.running.bus.latest(topics.ODOMETRY)
    if believed is not None:
        drift = true.to(PlanarPose.of(believed.T_odom_base))
        series["odometry_error"] = math.hypot(drift.x, drift.y)
    loss, result = episode.loss, episode.result
    module = f"lower_body: {method}"
    if loss is None and result is not None and not result.success:
        loss = Loss(result.stage, result.reason, result.trace)
        navigator = f"navigator: {episode.running.stack.choice('navigator').use}"
        module = navigator if result.slot == "navigator" else module
    if loss is None and radial > TOLERANCE:
        loss = Loss("goal", f"It stands {radial:.2f} m beside the goal and believes to be there.")
        module = f"estimator: {episode.running.stack.choice('estimator').use}"
    if loss is not None:
        return TrialOutcome(False, loss.stage, module, loss.detail, series=series, trace=loss.trace)
    detail = f"stands {1e3 * radial:.0f} mm from the goal"
    return TrialOutcome(True, DONE, None, detail, result.timings if result else {}, series)
