"""Rung `walk-twist`: how well a lower body follows the twists of its envelope."""

from __future__ import annotations

import itertools

import numpy as np

from golem.capabilities.legs.base import Envelope
from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode
from golem.evaluation.episodes.scripted_motion import ScriptedMotion
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions, judged
from golem.types import Twist

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
        """Run one trial; see `LegRung`."""
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
