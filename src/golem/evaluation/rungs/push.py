"""Rungs `push` and `push-ramp`: the paper's rod pushes the standing robot at the pelvis; one lower body per method."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from golem.evaluation.base import DONE, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, Loss
from golem.evaluation.episodes.last_seconds import FilmStrip
from golem.evaluation.episodes.scripted_motion import ArmMotion, ScriptedMotion
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions
from golem.robots.mujoco.balance import TRACE, BalanceTrace
from golem.robots.mujoco.shoves import DIRECTIONS, Push, ramp, rod
from golem.runtime.executor import when_stepped
from golem.skills.runner import FAULT

PEAK = (22.1, 6.9)
"""Mean and deviation of the rod's peak force [N], from the paper's ALMI trials."""
MIN_PEAK = 5.0
"""Peak below which a draw is raised to it [N]."""
SETTLE = (2.0, 3.0)
"""Range of the time between standing and the push [s]; the arms are then in motion."""
MOMENTS = (0.5, 0.5, 0.4, 0.6)
"""Times between the moments of the strip of pictures, from the begin of the push on [s]."""
PATIENCE = 5.0
"""Time after that in which the robot has to stand still again [s]; one that does not is judged as it is."""
QUIET = 1.0
"""Time of quiet standing that ends a trial [s]."""


class PushRung(LegRung[PlantOptions]):
    """Stand again, the CoM inside the support polygon, after the rod has pushed the pelvis once.

    The rod's force is not cut when the margin becomes negative, as a person's hand would: a robot that steps would
    otherwise be pushed less than one that does not.
    """

    name = "push"
    provokes = True
    facts: Mapping[str, object] = {"peak": PEAK, "settle": SETTLE, "patience": PATIENCE}

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        push, settle = self.draw(spec.rng("push"))
        with closing(self.episode(spec)) as episode:
            episode.start(ScriptedMotion(ArmMotion(spec.rng("arms"))))
            strip = FilmStrip(episode.robot, push.bearing)
            episode.stand(settle)
            if episode.loss is not None:
                loss, stage = episode.loss, FAULT if episode.loss.stage == FAULT else "settle"
                detail = f"{loss.detail.removesuffix('.')}. It was not pushed yet."
                return TrialOutcome(False, stage, f"lower_body: {spec.method}", detail, trace=loss.trace)
            start = episode.t
            episode.push(push)
            self.pursue(episode, strip)
            episode.run(PATIENCE, until=lambda: episode.recorder.quiet >= QUIET, due=when_stepped)
            strip.keep(episode.t, episode.force)
            trace = episode.recorder.trace()
            if artefacts is not None:
                trace.save(artefacts / TRACE)
            rests = episode.recorder.quiet >= QUIET
            outcome = judge(trace, start, push, episode.loss, rests, spec.method)
            shown = not outcome.success or spec.index == 0
            return replace(outcome, picture=strip.picture() if shown else None)

    def draw(self, rng: np.random.Generator) -> tuple[Push, float]:
        """Return the push of one trial, and the time before it [s]."""
        direction = DIRECTIONS[rng.integers(len(DIRECTIONS))]
        peak = max(float(rng.normal(*PEAK)), MIN_PEAK)
        return rod(direction, peak), float(rng.uniform(*SETTLE))

    def pursue(self, episode: Episode, strip: FilmStrip) -> None:
        """Go on with the push that has begun until it is over, and keep pictures of it."""
        for seconds in MOMENTS:
            strip.keep(episode.t, episode.force)
            episode.run(seconds)


def measures(trace: BalanceTrace, start: float) -> dict[str, float]:
    """Return the paper's measures of a push that began at `start` [s], SI units."""
    after = trace.window(min(start, float(trace.t[-1])))  # a stop may come before the next sample
    return {
        "peak_force": float(np.linalg.norm(after.force, axis=1).max()),
        "peak_lean": float(np.abs(after.rpy[:, 1]).max()),
        "peak_tilt": float(after.tilt.max()),
        "margin_before": trace.window(start - 0.5, start).final_margin,
        "margin_min": float(after.margin.min()),
        "margin_final": after.final_margin,
        "below_zero": after.below_zero,
        "steps": float(after.steps),
        "displacement": float(np.hypot(*(after.base[-1] - after.base[0])[:2])),
    }


def judge(trace: BalanceTrace, start: float, push: Push, loss: Loss | None, rests: bool, method: str) -> TrialOutcome:
    """Say whether the robot stands again after `push`, which began at `start` [s], and if not, how it failed."""
    series = measures(trace, start)
    pushed = f"pushed with {series['peak_force']:.0f} N to the {push.direction.replace('_', ' ')}"
    if loss is None and series["margin_final"] <= 0.0:
        loss = Loss("balance", f"The CoM margin ends at {1e3 * series['margin_final']:.0f} mm.")
    if loss is None and not rests:
        loss = Loss("unrest", "It is on its feet, but does not come to rest.")
    if loss is not None:
        detail = f"{loss.detail} It was {pushed} at {start:.1f} s."
        return TrialOutcome(False, loss.stage, f"lower_body: {method}", detail, series=series, trace=loss.trace)
    recovery = trace.recovery_time(start)
    # A robot that never lost its balance has none to recover.
    timings = {"recovery": recovery} if recovery > 0.0 else {}
    return TrialOutcome(True, DONE, None, f"stands, {pushed}", timings, series)


RATE = 40.0
"""Growth of the force [N/s] [own: a person's; the paper does not say]."""
MAX_FORCE = 300.0
"""Force at which the push ends although the balance is not lost [N] [own: nearly half the robot's weight]."""


class PushRampRung(PushRung):
    """Stand again after the rod has pushed harder and harder until the CoM left the support polygon.

    The paper's robots were pushed so by hand: "until the robot loses balance", by a margin that becomes negative. Who
    steps is pushed on while the polygon follows, so `peak_force` says what a method takes, and the rest of the figures
    what it makes of a balance that is lost.
    """

    name = "push-ramp"
    facts = {**PushRung.facts, "peak": (MAX_FORCE, RATE)}

    def draw(self, rng: np.random.Generator) -> tuple[Push, float]:
        direction = DIRECTIONS[rng.integers(len(DIRECTIONS))]
        return ramp(direction, MAX_FORCE, MAX_FORCE / RATE), float(rng.uniform(*SETTLE))

    def pursue(self, episode: Episode, strip: FilmStrip) -> None:
        """Push until the balance is lost, and keep pictures of what comes then."""
        strip.keep(episode.t, episode.force)
        episode.run(MAX_FORCE / RATE, until=lambda: episode.recorder.margin < 0.0, due=when_stepped)
        strip.keep(episode.t, episode.force)
        episode.let_go()
        for seconds in MOMENTS[:-1]:
            episode.run(seconds)
            strip.keep(episode.t, episode.force)
