"""What rungs that push a lower body at a chosen moment have in common: the moment, the push, the judgement."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal, TypeVar

from golem.errors import ConfigError, ModuleFault, unknown_name
from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Loss
from golem.evaluation.episodes.moments import Moment, Phase, PushedEpisode
from golem.evaluation.harness.copies import CAN_COPY, in_a_copy
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions, can_walk, judged, no_walker
from golem.robots.mujoco.shoves import DIRECTIONS, rod, shove
from golem.skills.base import FAULT
from golem.types import Twist

PATIENCE = 4.0
"""Time after the push that has to be survived [s]."""
QUIET = 0.5
"""Time of quiet standing after which nothing more can happen [s]."""
STILL = "0"
"""The walk of a robot that stands."""
Gait = tuple[Phase, str]
"""A phase, and the twist of its walk as the options write it; `STILL` of a robot that stands."""


def walk_twist(word: str) -> Twist:
    """Return the twist that `word` of `--walk` means, e.g. `0.3` or `0.3,0,0.4`.

    Raises:
        ConfigError: it is no twist, or that of a robot that stands.
    """
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

    def __init__(self, options: O | None = None) -> None:
        """Check the directions and phases; see `Rung`."""
        super().__init__(options)
        for name in self.options.direction:
            if name not in DIRECTIONS:
                raise unknown_name("direction", name, DIRECTIONS)
        self._each("phase", "direction", "walk")
        for word in self.options.walk:
            walk_twist(word)

    def _each(self, *options: str) -> None:
        """Check options that name several things.

        Raises:
            ConfigError: one names nothing, or something twice.
        """
        for option in options:
            names = getattr(self.options, option)
            if not names or len(set(names)) < len(names):
                raise ConfigError(f"--{option} names nothing, or one of them twice.")

    @property
    def gaits(self) -> Sequence[Gait]:
        """What the robot does when it is pushed: each phase, those of walking at each twist."""
        o = self.options
        return [(p, walk) for p in o.phase for walk in ((STILL,) if p == "standing" else o.walk)]

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial; see `Rung`."""
        return self.run_together([spec])[0]

    def run_together(self, specs: Sequence[TrialSpec]) -> Sequence[TrialOutcome]:
        """Bring one robot to the moment of the push, and push it from there, each time in a copy of the process."""
        if len(specs) > 1 and not CAN_COPY:
            return [self.run(spec, None) for spec in specs]
        return self.pushed(specs)

    def pushed(self, specs: Sequence[TrialSpec]) -> Sequence[TrialOutcome]:
        """Push the robot of a stack, in all the ways that `specs` say."""
        spec = specs[0]
        with closing(self.episode(spec)) as episode:
            walks = can_walk(episode.running.envelope)
            return self.from_moment(specs, episode, walks, partial(self.moment(spec).reach, spec))

    def moment(self, spec: TrialSpec) -> Moment:
        """Return when the push of a trial comes."""
        phase: Phase = spec.case["phase"]  # type: ignore[assignment] - checked when the options were read
        twist = Twist() if phase == "standing" else walk_twist(str(spec.case["walk"]))
        return Moment.of(spec, phase, twist)

    def from_moment(
        self,
        specs: Sequence[TrialSpec],
        episode: PushedEpisode,
        walks: bool,
        reach: Callable[..., Loss | None],
    ) -> Sequence[TrialOutcome]:
        """Bring a robot to the moment by `reach`, and push it from there."""
        if specs[0].case["phase"] != "standing" and not walks:
            return [no_walker(spec.method) for spec in specs]
        loss = reach(episode)
        if loss is not None:
            return [judged(spec.method, loss, {}) for spec in specs]
        if len(specs) == 1:
            return [self._push(episode, specs[0])]
        return [in_a_copy(partial(self._push, episode, spec)) for spec in specs]

    def _push(self, episode: PushedEpisode, spec: TrialSpec) -> TrialOutcome:
        """Push the robot and wait."""
        make = shove if self.options.kind == "shove" else rod
        push, standing = (
            make(str(spec.case["direction"]), float(spec.case["level"])),
            spec.case["phase"] == "standing",
        )
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
