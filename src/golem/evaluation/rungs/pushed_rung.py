"""Base of the rungs that push a lower body at a chosen moment: standing, walking, or with one foot in the air.

The robot is one of the stack (`Episode`), with its gate, estimator, latency and working arms, or one on its own terms
(`PlainEpisode`); from there on both are pushed and judged alike.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Literal, TypeVar

from golem.errors import ConfigError, ModuleFault, check_known
from golem.evaluation.base import Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, Loss
from golem.evaluation.episodes.plain_episode import PlainEpisode
from golem.evaluation.episodes.scripted_motion import ArmMotion, ScriptedMotion
from golem.evaluation.harness.copies import CAN_COPY, in_a_copy
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions, can_walk, judged, no_walker
from golem.robots.mujoco.shoves import DIRECTIONS, rod, shove
from golem.skills.base import FAULT
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


PushedEpisode = Episode | PlainEpisode


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
    def of(cls, spec: TrialSpec) -> Moment:
        """Return the moment that a trial draws."""
        phase: Phase = spec.case["phase"]  # type: ignore[assignment] - checked when the options were read
        twist = Twist() if phase == "standing" else walk_twist(str(spec.case["walk"]))
        times = spec.rng("times")
        return cls(phase, twist, times.uniform(*SETTLE), times.uniform(0.0, SWING))

    def reach(self, spec: TrialSpec, episode: PushedEpisode) -> Loss | None:
        """Bring a robot there, that of a stack with its arms moving; return how it was lost before, or None."""
        walks = self.phase != "standing"
        if isinstance(episode, PlainEpisode):
            episode.run(self.settle)
            if walks:
                episode.twist = self.twist
        else:
            motion = ScriptedMotion(ArmMotion(spec.rng("arms")))
            episode.start(motion)
            episode.stand(self.settle)
            if walks:
                motion.twist = lambda t: self.twist
        if walks:
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


PATIENCE = 4.0
"""Time after the push that has to be survived [s]."""
QUIET = 0.5
"""Time of quiet standing after which nothing more can happen [s]."""
STILL = "0"
"""The walk of a robot that stands."""
Gait = tuple[Phase, str]
"""A phase, and the twist of its walk as the options write it; `STILL` of a robot that stands."""


def walk_twist(word: str) -> Twist:
    """Return the twist of a `word` of `--walk`, e.g. `0.3` or `0.3,0,0.4`. Raises ConfigError: none, or standing."""
    try:
        numbers = [float(number) for number in word.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 3) or not all(map(math.isfinite, numbers)) or not any(numbers):
        raise ConfigError(
            f"--walk '{word}' is neither a speed ahead, e.g. 0.3, nor vx,vy,wz, e.g. 0.3,0,0.4, other than zero; "
            "a robot that stands is --phase standing."
        )
    return Twist(*numbers)


def gait_name(gait: Gait) -> str:
    """Return how tables call a gait, e.g. `left swing at 0.3`."""
    phase, walk = gait
    return phase if phase == "standing" else f"{phase.replace('_', ' ')} at {walk}"


@dataclass(frozen=True)
class PushedOptions(PlantOptions):
    """The push, and when it comes."""

    kind: Literal["shove", "rod"] = "shove"
    """shove: constant force on the torso for 0.2 s, levels in N s. rod: half a sine of 1 s at the pelvis, in N."""
    phase: tuple[Phase, ...] = ("standing", "left_swing", "right_swing")
    """When the push comes: standing, walking at any moment, or walking while that foot is in the air."""
    direction: tuple[str, ...] = DIRECTIONS
    """Where the push drives the robot."""
    walk: tuple[str, ...] = ("0.3",)
    """Twists of the phases of walking, each as vx or vx,vy,wz [m/s, m/s, rad/s], e.g. 0.3 0.6 0.3,0,0.4."""


O = TypeVar("O", bound=PushedOptions)  # noqa: E741 - the options


class PushedRung(LegRung[O]):
    """A rung whose cases name a phase, a direction and the level of a push."""

    Options = PushedOptions
    provokes = True
    default_n = 20
    default_profile = "bench"
    run = Rung.run  # one alone is pushed as several are

    def __init__(self, options: O | None = None) -> None:
        super().__init__(options)
        check_known("direction", DIRECTIONS, *self.options.direction)
        for word in self.options.walk:
            walk_twist(word)

    @property
    def gaits(self) -> Sequence[Gait]:
        """What the robot does when it is pushed: each phase, those of walking at each twist."""
        o = self.options
        return [(p, walk) for p in o.phase for walk in ((STILL,) if p == "standing" else o.walk)]

    def together(self, spec: TrialSpec) -> Hashable:
        """Return what trials share that have one past: all but level and direction."""
        past = (value for name, value in spec.case.items() if name not in ("level", "direction"))
        return spec.method, spec.index, *past

    def run_together(self, specs: Sequence[TrialSpec]) -> Sequence[TrialOutcome]:
        """Bring one robot to the moment of the push, and push it from there, each time in a copy of the process."""
        if len(specs) > 1 and not CAN_COPY:
            return [self.run(spec, None) for spec in specs]
        spec = specs[0]
        with closing(self.robot(spec)) as episode:
            envelope = episode.envelope if isinstance(episode, PlainEpisode) else episode.running.envelope
            if spec.case["phase"] != "standing" and not can_walk(envelope):
                return [no_walker(each.method) for each in specs]
            loss = Moment.of(spec).reach(spec, episode)
            if loss is not None:
                return [judged(each.method, loss, {}) for each in specs]
            if len(specs) == 1:
                return [self._push(episode, spec)]
            return [in_a_copy(partial(self._push, episode, each)) for each in specs]

    def robot(self, spec: TrialSpec) -> PushedEpisode:
        """Return the robot that is pushed: that of the stack."""
        return self.episode(spec)

    def _push(self, episode: PushedEpisode, spec: TrialSpec) -> TrialOutcome:
        make, standing = shove if self.options.kind == "shove" else rod, spec.case["phase"] == "standing"
        push = make(str(spec.case["direction"]), float(spec.case["level"]))
        start, loss = episode.t, None
        try:
            episode.push(push)
            episode.run(push.duration)
            episode.recorder.quiet = 0.0
            episode.run(PATIENCE, until=lambda: standing and episode.recorder.quiet >= QUIET)
        except ModuleFault as fault:
            loss = Loss(FAULT, fault.reason, fault.trace)
        trace = episode.recorder.trace()
        before, after = trace.window(start - 1.0, start), trace.window(start)
        series = {"steps": float(after.steps), "speed_before": float(before.twist[:, 0].mean())}
        if len(after.tilt):
            series["peak_tilt"] = float(after.tilt.max())
        return judged(spec.method, loss or episode.loss, series)
