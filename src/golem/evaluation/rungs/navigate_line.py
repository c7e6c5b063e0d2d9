"""Rung `navigate-line`: the paper's 6 m straight line over the open floor, by odometry; one lower body per method."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from golem import registry
from golem.evaluation.base import DONE, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, Loss, episode_seed, legs_stack
from golem.evaluation.episodes.film_strip import FilmStrip
from golem.evaluation.episodes.odometry import SimulatedOdometry
from golem.interfaces import topics
from golem.provenance import stack_facts
from golem.robots.mujoco.balance import TRACE
from golem.robots.sensors.profiles import PROFILES
from golem.skills.walk import Walk, WalkGoal
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
NO_WALKER = "walk"
"""Stage in which a lower body fails that cannot walk."""


class NavigateLine:
    """The robot walks to (6, 0, 0) in odom; the error is that of the true pose.

    There is no LiDAR odometry yet: the robot goes by its base estimator, to whose pose a noise of 1 cm and 1 deg is
    added (`golem.evaluation.episodes.odometry`, source `estimator`). The drift of legs and IMU over the line is in the
    error.
    """

    name = "navigate-line"
    profiles = tuple(PROFILES)

    def methods(self) -> tuple[str, ...]:
        """Return the registered lower bodies; `policy:DESCRIPTION:NETWORK` names a policy's files."""
        return registry.names("lower_body")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        return {
            **stack_facts(legs_stack(method, profile, overrides)),
            "distance": DISTANCE,
            "tolerance": TOLERANCE,
        }

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial; see `Rung`."""
        stack = legs_stack(spec.method, spec.profile, spec.overrides)
        with closing(Episode(stack, episode_seed(spec.seed, spec.index))) as episode:
            if episode.running.envelope.vx[1] <= 0.0:
                why = "It does not walk: the greatest forward speed in its envelope is zero."
                return TrialOutcome(False, NO_WALKER, f"lower_body: {spec.method}", why)
            odometry = SimulatedOdometry(
                episode.running.bus, episode.robot, "estimator", spec.rng("odometry")
            )
            episode.locate(odometry)
            strip = FilmStrip(episode.robot, 0.0)
            episode.stand(SETTLE)
            if not episode.over:
                goal = WalkGoal(DISTANCE, 0.0, 0.0, "odom", TIMEOUT)
                episode.start(Walk(episode.running.navigator), goal)
            for _ in range(PICTURES - 1):
                strip.keep(episode.t, np.zeros(3))
                episode.run(DISTANCE / PICTURES / 0.4, until=lambda: episode.result is not None)
            episode.run(TIMEOUT, until=lambda: episode.result is not None)
            strip.keep(episode.t, np.zeros(3))
            if artefacts is not None:
                episode.recorder.trace().save(artefacts / TRACE)
            outcome = judge(episode, spec.method)
            shown = not outcome.success or spec.index == 0
            return replace(outcome, picture=strip.picture() if shown else None)


def judge(episode: Episode, method: str) -> TrialOutcome:
    """Say where the robot ended."""
    trace, truth = episode.recorder.trace(), episode.robot.truth
    true = PlanarPose.of(np.linalg.inv(truth.T_world_odom) @ truth.base().T_world_base)
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
        loss = Loss(result.stage, result.reason)
        module = (
            f"navigator: {episode.running.stack.choice('navigator').use}"
            if result.slot == "navigator"
            else module
        )
    if loss is None and radial > TOLERANCE:
        loss = Loss("goal", f"It stands {radial:.2f} m beside the goal and believes to be there.")
        module = f"estimator: {episode.running.stack.choice('estimator').use}"
    if loss is not None:
        return TrialOutcome(False, loss.stage, module, loss.detail, series=series)
    detail = f"stands {1e3 * radial:.0f} mm from the goal"
    return TrialOutcome(True, DONE, None, detail, result.timings if result else {}, series)
