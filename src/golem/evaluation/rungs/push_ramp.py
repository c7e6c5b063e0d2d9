"""Rung `push-ramp`: the rod pushes harder and harder until the robot has lost its balance, and then lets go."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from golem.evaluation.episodes.episode import Episode
from golem.evaluation.episodes.film_strip import FilmStrip
from golem.evaluation.rungs.push import MOMENTS, SETTLE, PushRung
from golem.robots.mujoco.shoves import DIRECTIONS, Push, ramp
from golem.runtime.executor import when_stepped

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

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        return {**super().config(method, profile, overrides), "peak": (MAX_FORCE, RATE)}

    def draw(self, rng: np.random.Generator) -> tuple[Push, float]:
        """Return the push of one trial, and the time before it [s]."""
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
