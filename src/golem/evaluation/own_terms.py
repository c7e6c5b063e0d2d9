"""One shove of a lower body on its own terms; see `golem.evaluation.episodes.plain_episode`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

from golem.evaluation.base import TrialSpec
from golem.evaluation.episodes.plain_episode import PlainEpisode
from golem.evaluation.harness.pool import in_a_copy
from golem.evaluation.leg_tests import can_walk
from golem.evaluation.push_bench import DOES_NOT_WALK, PATIENCE, QUIET, SETTLE, STEP, SWING, TRIES
from golem.robots.mujoco.shoves import shove
from golem.types import Twist

Phase = Literal["standing", "walking", "left_swing", "right_swing"]
"""When the shove comes: standing, walking at any moment, or walking while that foot is in the air."""


@dataclass(frozen=True, slots=True)
class OwnTermsTrial:
    """One robot on its own terms, shoved in several directions from one moment.

    Attributes:
        method: what moves the legs, see `PlainEpisode`.
        mjcf: file of the robot; None is ours.
        phase: when the shove comes.
        twist: vx, vy [m/s] and wz [rad/s] at which it walks, in a phase of walking.
        directions: where the shove drives the robot, one after the other.
        level: its impulse [N s].
        index, seed: the draws, the same for every method.
    """

    method: str
    mjcf: str | None
    phase: Phase
    twist: tuple[float, float, float]
    directions: tuple[str, ...]
    level: float
    index: int
    seed: int

    def run(self) -> dict[str, dict[str, Any]]:
        """Return by direction in which stage the robot was `lost` (None where it survived) and figures.

        They are `lean`, the largest tilt of the base from the shove on [rad], `steps`, the feet lifted since, and
        `speed`, the mean forward speed in the last second before it [m/s]; none where the robot was lost before.
        """
        draw = TrialSpec("legs", self.method, "own", self.seed, self.index)
        times = draw.rng("times")
        settle, late = times.uniform(*SETTLE), times.uniform(0.0, SWING)
        path = None if self.mjcf is None else Path(self.mjcf)
        episode = PlainEpisode(self.method, path, draw.rng("start"))
        episode.run(settle)
        lost = self._walk(episode, settle, late)
        if lost is not None:
            return {direction: {"lost": lost} for direction in self.directions}
        return {d: in_a_copy(partial(self._shove, episode, d)) for d in self.directions}

    def _walk(self, episode: PlainEpisode, seconds: float, late: float) -> str | None:
        """Bring the robot to the moment of the shove; return the stage in which it was lost, or None."""
        if self.phase != "standing":
            if not can_walk(episode.envelope):
                return DOES_NOT_WALK
            episode.twist = Twist(*self.twist)
            episode.run(seconds)
            if self.phase != "walking" and not reach_swing(episode, self.phase, late):
                return "no step" if episode.loss is None else episode.loss.stage
        return None if episode.loss is None else episode.loss.stage

    def _shove(self, episode: PlainEpisode, direction: str) -> dict[str, Any]:
        """Shove the robot and wait; return what became of it."""
        start, push = episode.t, shove(direction, self.level)
        standing = self.phase == "standing"
        episode.push(push)
        episode.run(push.duration)
        episode.recorder.quiet = 0.0
        episode.run(PATIENCE, until=lambda: standing and episode.recorder.quiet >= QUIET)
        trace = episode.recorder.trace()
        before, after = trace.window(start - 1.0, start), trace.window(start)
        return {
            "lost": None if episode.loss is None else episode.loss.stage,
            "lean": float(after.tilt.max()),
            "steps": after.steps,
            "speed": float(before.twist[:, 0].mean()),
        }


def reach_swing(episode: PlainEpisode, phase: Phase, late: float) -> bool:
    """Walk until the foot of the phase was lifted `late` [s] ago and is still in the air; False if it never is."""
    air = [phase != "left_swing", phase != "right_swing"]

    def swings() -> bool:
        return episode.recorder.contact.tolist() == air

    for _ in range(TRIES):
        episode.run(STEP, until=lambda: not swings())
        episode.run(STEP, until=swings)
        episode.run(late)
        if episode.over or swings():
            return True
    return False
