"""Rungs `walk-slope` and `walk-rubble`: ten seconds ahead on rough ground."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode
from golem.evaluation.episodes.scripted_motion import ScriptedMotion
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions, judged
from golem.evaluation.rungs.walk_twist import SETTLE
from golem.types import Twist

AHEAD = Twist(vx=0.4)
"""The twist."""
SECONDS = 10.0
"""Time it is commanded [s]: ramp and tiles begin a metre ahead and end after three more."""


class WalkSlope(LegRung[PlantOptions]):
    """Walk ahead and up a ramp of 5 degrees."""

    name = "walk-slope"
    default_n = 20
    default_profile = "bench"
    twin: Mapping[str, object] = {"world": "slope"}
    walks = True

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        """Run one trial; see `LegRung`."""
        episode.stand(SETTLE)
        start = episode.t
        episode.start(ScriptedMotion(twist=lambda t: AHEAD))
        episode.run(SECONDS)
        if episode.loss is not None:
            return judged(spec.method, episode.loss, {})
        path = episode.recorder.trace().window(start).base
        climbed, moved = path[-1, 2] - path[0, 2], np.hypot(*(path[-1] - path[0])[:2])
        return judged(spec.method, None, {"distance": float(moved), "climbed": float(climbed)})


class WalkRubble(WalkSlope):
    """Walk ahead over tiles of uneven height, up to 3 cm."""

    name = "walk-rubble"
    twin: Mapping[str, object] = {"world": "rubble"}
