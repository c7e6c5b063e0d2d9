"""What the rungs of lower bodies have in common: a standing stack, one lower body in it, one plant under it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from golem.capabilities.legs.base import Envelope
from golem.errors import ConfigError
from golem.evaluation.base import DONE, Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import LATENCY, Episode, Loss, episode_seed, legs_stack
from golem.evaluation.harness.arguments import robot_options
from golem.hardware.safety.base import SafetyLimits
from golem.provenance import stack_facts
from golem.stack import Stack

NO_WALKER = "walk"
"""Stage in which a lower body fails that cannot walk."""


@dataclass(frozen=True)
class PlantOptions:
    """The twin under the lower bodies."""

    latency: float = LATENCY
    """Delay of motor commands on top of the profile's [s]."""
    robot: tuple[str, ...] = ()
    """Further options of the twin, e.g. feet=box cone=elliptic, or mjcf=../h1_2.xml."""
    height: float | None = None
    """Height of base_link at which a robot stands whose legs take one [m]; default: their own."""


O = TypeVar("O", bound=PlantOptions)  # noqa: E741 - the options


class LegRung(Rung[O]):
    """A rung whose methods are lower bodies; `policy:DESCRIPTION:NETWORK` names a policy's files.

    Attributes:
        twin: further options of the twin that the rung asks for.
        walks: whether a lower body has to walk.
        facts: what determines a trial besides its stack and its seed.
    """

    Options = PlantOptions
    default_methods = ("almi",)
    slot = "lower_body"
    twin: Mapping[str, object] = {}
    walks: bool = False
    facts: Mapping[str, object] = {}

    def _each(self, *options: str) -> None:
        """Check options that name several things. Raises ConfigError: one names nothing, or something twice."""
        for option in options:
            names = getattr(self.options, option)
            if not names or len(set(names)) < len(names):
                raise ConfigError(f"--{option} names nothing, or one of them twice.")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        return {**stack_facts(self.stack(method, profile, overrides)), **self.facts}

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        with closing(self.episode(spec)) as episode:
            if self.walks and not can_walk(episode.running.envelope):
                return no_walker(spec.method)
            return self.trial(spec, episode)

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        """Run one trial with a robot that hangs in its band and can walk where it has to; `run` closes it."""
        raise NotImplementedError

    def stack(
        self, method: str, profile: str, overrides: Mapping[str, str], twin: Mapping[str, object] | None = None
    ) -> Stack:
        """Return the standing stack with a lower body on the plant; `twin` stands for the rung's own options of it."""
        own = self.twin if twin is None else twin
        plant = {"latency": self.options.latency, **robot_options(self.options.robot), **own}
        return legs_stack(method, profile, overrides, plant)

    def trial_stack(self, spec: TrialSpec) -> Stack:
        """Return the stack of a trial, for a rung whose cases differ in it."""
        return self.stack(spec.method, spec.profile, spec.overrides)

    def limits(self, spec: TrialSpec, stack: Stack) -> SafetyLimits | None:
        """Return what the gate of a trial enforces; None is what its `stack` says."""
        return None

    def episode(self, spec: TrialSpec) -> Episode:
        """Return the robot of a trial, which is to stand at the height that was asked for."""
        stack = self.trial_stack(spec)
        episode = Episode(stack, episode_seed(spec.seed, spec.index), self.onlooker, self.limits(spec, stack))
        episode.height = self.options.height
        return episode


def can_walk(envelope: Envelope) -> bool:
    """Return whether a lower body follows any twist at all."""
    return any(envelope.axes)


def no_walker(method: str) -> TrialOutcome:
    """Return the outcome of a lower body that only stands, where it is asked to walk."""
    return TrialOutcome(False, NO_WALKER, f"lower_body: {method}", "It does not walk: its envelope is empty.")


def judged(
    method: str, loss: Loss | None, series: Mapping[str, float], timings: Mapping[str, float] | None = None
) -> TrialOutcome:
    """Return the outcome of a lower body: lost as `loss` says, or a success."""
    if loss is None:
        return TrialOutcome(True, DONE, timings=timings or {}, series=series)
    return TrialOutcome(
        False, loss.stage, f"lower_body: {method}", loss.detail, timings or {}, series, trace=loss.trace
    )
