"""Rung `walk-endurance`: a minute of random twists, arms moving, pushed every few seconds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from golem.capabilities.legs.base import Envelope
from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode
from golem.evaluation.episodes.scripted_motion import ArmMotion, ScriptedMotion
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions, can_walk, judged, no_walker
from golem.evaluation.rungs.walk_twist import SETTLE, random_twist
from golem.robots.mujoco.shoves import DIRECTIONS, shove
from golem.types import Twist

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
        """Run one trial; see `LegRung`."""
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
