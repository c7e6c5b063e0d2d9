"""Rungs `stand-quiet` and `stand-arms`: a minute on its feet, still or while the arms sweep."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, Loss
from golem.evaluation.episodes.scripted_motion import WIDE_AREA, ArmMotion, ScriptedMotion
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions, judged

MINUTE = 60.0
"""Length of the test [s]."""
SETTLE = 3.0
"""Time between a robot carrying its weight and the test [s]: what the release of its band set off has died away."""
CALM = 10.0
"""The same for quiet standing [s]: a policy takes 5 s over the last centimetre back from the release."""
PAYLOAD = (1.0, 1.0)
"""Mass in the left and the right hand while the arms sweep [kg]."""


class StandQuiet(LegRung[PlantOptions]):
    """Stand still for a minute, the CoM margin never negative."""

    name = "stand-quiet"
    default_n = 10
    default_profile = "bench"
    settle = CALM

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        episode.stand(self.settle)
        start = episode.t
        episode.run(MINUTE)
        if episode.loss is not None:
            return judged(spec.method, episode.loss, {})
        series = standing(episode, start)
        margin = 1e3 * series["margin_min"]
        loss = Loss("balance", f"The least CoM margin was {margin:.0f} mm.") if margin < 0.0 else None
        return judged(spec.method, loss, series)


class StandArms(StandQuiet):
    """Stand for a minute while both arms sweep their workspace with a kilogram in each hand, margin never negative."""

    name = "stand-arms"
    twin: Mapping[str, object] = {"payload": PAYLOAD}
    settle = SETTLE

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        episode.start(ScriptedMotion(ArmMotion(spec.rng("arms"), WIDE_AREA)))
        return super().trial(spec, episode)


def standing(episode: Episode, start: float) -> dict[str, float]:
    """Return how the robot has stood since `start` [s]."""
    stood = episode.recorder.trace().window(start)
    off = {} if episode.height is None else {"height_error": float(np.abs(stood.base[:, 2] - episode.height).max())}
    return off | {
        "base_range": stood.base_range,
        "sway": stood.sway,
        "steps": float(stood.steps),
        "margin_median": float(np.median(stood.margin)),
        "margin_min": float(stood.margin.min()),
        "share_not_negative": float((stood.margin >= 0.0).mean()),
    }
