"""A robot brought to the moment at which a push meets it: standing, walking, or with one foot in the air.

The robot is one of the stack (`Episode`), with its gate, estimator, latency and working arms, or one on its own terms
(`PlainEpisode`); from there on both are pushed and judged alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

from golem.evaluation.base import TrialSpec
from golem.evaluation.episodes.episode import Episode, Loss
from golem.evaluation.episodes.plain_episode import PlainEpisode
from golem.evaluation.episodes.scripted_motion import ArmMotion, ScriptedMotion
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.shoves import Push
from golem.types import Twist

Phase = Literal["standing", "walking", "left_swing", "right_swing"]
"""When the push comes: standing, walking at any moment, or walking while that foot is in the air."""

SETTLE = (2.0, 3.0)
"""Range of the time of standing before the push or before walking, and of walking before the push [s]."""
SWING = 0.15
"""The push meets a swinging foot up to so long after it was lifted [s]."""
STEP = 2.0
"""Time in which a robot that walks lifts each foot [s]."""
TRIES = 5
"""Swings of that foot that may end before the push: a sole chatters, or a step is short."""
NO_STEP = Loss("no step", "It never lifted that foot for long enough.")
"""A robot that walks without a step."""


class PushedEpisode(Protocol):
    """What both kinds of episode have in common."""

    recorder: BalanceRecorder

    @property
    def t(self) -> float:
        """Robot time [s]."""
        ...

    @property
    def loss(self) -> Loss | None:
        """How the robot was lost; None while it was not."""
        ...

    def run(self, seconds: float, until: Callable[[], bool] = ...) -> None:
        """Let up to `seconds` of robot time pass."""
        ...

    def push(self, push: Push) -> None:
        """Begin a push now."""
        ...


@dataclass(frozen=True, slots=True)
class Moment:
    """When a push comes.

    Attributes:
        phase: see `Phase`.
        twist: at which the robot walks in a phase of walking.
        settle: time of standing, and of walking, before [s].
        late: time after the foot was lifted [s].
    """

    phase: Phase
    twist: Twist
    settle: float
    late: float

    @classmethod
    def of(cls, spec: TrialSpec, phase: Phase, twist: Twist) -> Moment:
        """Return the moment that a trial draws."""
        times = spec.rng("times")
        return cls(phase, twist, times.uniform(*SETTLE), times.uniform(0.0, SWING))

    def reach(self, spec: TrialSpec, episode: Episode) -> Loss | None:
        """Bring the robot of a stack there, its arms moving; return how it was lost before, or None."""
        motion = ScriptedMotion(ArmMotion(spec.rng("arms")))
        episode.start(motion)
        episode.stand(self.settle)
        if self.phase != "standing":
            motion.twist = lambda t: self.twist
        return self._walk(episode)

    def reach_plainly(self, episode: PlainEpisode) -> Loss | None:
        """Bring a robot on its own terms there; return how it was lost before, or None."""
        episode.run(self.settle)
        if self.phase != "standing":
            episode.twist = self.twist
        return self._walk(episode)

    def _walk(self, episode: PushedEpisode) -> Loss | None:
        if self.phase != "standing":
            episode.run(self.settle)
            if self.phase != "walking" and not self._swing(episode):
                return episode.loss or NO_STEP
        return episode.loss

    def _swing(self, episode: PushedEpisode) -> bool:
        """Walk until the foot of the phase was lifted `late` ago and is still in the air; False if it never is."""
        air = [self.phase != "left_swing", self.phase != "right_swing"]

        def swings() -> bool:
            return episode.recorder.contact.tolist() == air

        for _ in range(TRIES):
            episode.run(STEP, until=lambda: not swings())
            episode.run(STEP, until=swings)
            episode.run(self.late)
            if episode.loss is not None or swings():
                return True
        return False
