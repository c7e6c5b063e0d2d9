"""Rung `walk-rough`: ten seconds ahead on ground, or under a load, that is hard to walk with."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from golem.errors import unknown_name
from golem.evaluation.base import Case, Results, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode
from golem.evaluation.episodes.scripted_motion import ArmMotion, ScriptedMotion
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions, judged
from golem.evaluation.rungs.walk_twist import SETTLE
from golem.provenance import stack_facts
from golem.stack import Stack
from golem.types import Twist

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
    Options = WalkRoughOptions
    default_n = 20
    default_profile = "bench"
    walks = True

    def __init__(self, options: WalkRoughOptions | None = None) -> None:
        """Check the grounds; see `Rung`."""
        super().__init__(options)
        self._each("ground")
        for ground in self.options.ground:
            if ground not in GROUNDS:
                raise unknown_name("ground", ground, GROUNDS)

    def cases(self, results: Results) -> Sequence[Case]:
        """Return every ground."""
        return [{"ground": ground} for ground in self.options.ground]

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        grounds = self.options.ground
        return {g: stack_facts(self.stack(method, profile, overrides, GROUNDS[g])) for g in grounds}

    def trial_stack(self, spec: TrialSpec) -> Stack:
        """Return the stack of a trial, on the ground of its case."""
        return self.stack(spec.method, spec.profile, spec.overrides, GROUNDS[str(spec.case["ground"])])

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        """Run one trial; see `LegRung`."""
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
