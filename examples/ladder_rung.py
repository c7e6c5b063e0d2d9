"""A rung of your own: who stands for three seconds after a shove of 20 N s? One trial of it."""

from __future__ import annotations

from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode
from golem.evaluation.harness.trials import run_trial
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions, judged
from golem.robots.mujoco.shoves import shove


class ShovedOnce(LegRung[PlantOptions]):
    """Stand three seconds after a shove from the front."""

    name = "shoved-once"

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        """Run one trial with a robot that hangs in its band."""
        episode.stand(0.5)
        episode.push(shove("back", 20.0))
        episode.run(3.0)
        return judged(spec.method, episode.loss, {"margin_min": float(episode.recorder.trace().margin.min())})


def main() -> None:
    rung = ShovedOnce()
    outcome = run_trial(rung, TrialSpec(rung.name, "almi", "bench", seed=0, index=0))
    margin = 1e3 * outcome.series["margin_min"]
    print(f"almi {'stands' if outcome.success else 'is lost'}, least margin of the CoM {margin:.0f} mm")


if __name__ == "__main__":
    main()
