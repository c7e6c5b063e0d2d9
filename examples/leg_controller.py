"""A leg controller of your own: stiff joints in a crouch. Does the robot stand on it?"""

from __future__ import annotations

from contextlib import closing

import numpy as np

from golem.capabilities.legs.base import Envelope, LocomotionCommand
from golem.capabilities.legs.gait import GaitConfig
from golem.evaluation.episodes.episode import Episode, legs_stack
from golem.interfaces.payloads import LegCommand
from golem.types import BaseEstimate, LowState

CROUCH = np.tile([0.0, -0.4, 0.0, 0.8, -0.4, 0.0], 2)  # left leg first [rad]


class Stiff:
    """Stands in a crouch; follows no twist."""

    rate, latency, envelope, gait = 200.0, 0.001, Envelope(), GaitConfig(start="never")

    def reset(self, state: LowState) -> None:
        self.q = np.array(state.q[:12])

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        self.q = self.q + np.clip(CROUCH - self.q, -0.5 * dt, 0.5 * dt)
        return LegCommand(self.q.copy(), np.full(12, 500.0), np.full(12, 12.0), np.zeros(12))


def main() -> None:
    with closing(Episode(legs_stack(f"{__file__}:Stiff", "ideal"), seed=0)) as episode:
        episode.stand(2.0)
        trace = episode.recorder.trace()
        print(episode.loss or f"stands; least margin of the CoM {1e3 * trace.margin.min():.0f} mm")


if __name__ == "__main__":
    main()
