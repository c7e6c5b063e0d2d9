"""What the rungs of lower bodies have in common: a standing stack, one lower body in it, a plant, a safety gate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from golem.capabilities.legs.base import Envelope
from golem.errors import ConfigError, check_known
from golem.evaluation.base import DONE, Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import LATENCY, Episode, Loss, episode_seed, legs_stack
from golem.evaluation.harness.arguments import robot_options
from golem.hardware.safety.base import SafetyLimits
from golem.provenance import stack_facts
from golem.stack import Stack
from golem.types import NUM_JOINTS

NO_WALKER = "walk"
"""Stage in which a lower body fails that cannot walk."""


Lift = Callable[[SafetyLimits], SafetyLimits]
"""Returns limits of which some are lifted."""
NOTHING = "nothing"
"""The gate as it ships."""
FAR = np.full(NUM_JOINTS, 1e3)
"""Beyond every position [rad], speed [rad/s] and torque [N m] of a robot."""
STOPS: dict[str, Lift] = {
    "speed": lambda limits: replace(limits, velocity=FAR),
    "range": lambda limits: replace(limits, state_lower=-FAR, state_upper=FAR),
    "torque": lambda limits: replace(limits, torque_samples=10**9),
    "tilt": lambda limits: replace(limits, tilt=math.pi),
    "balance": lambda limits: replace(limits, capture=(math.inf,) * 2, sinking=math.inf, lean=math.inf, low=-math.inf),
    "sender": lambda limits: replace(
        limits,
        sane=np.full_like(limits.sane, 1e6),
        jolts=math.inf,
        throw=(1e6, 1e6, 1e6),
        hung=math.inf,
        least_kp=np.full(NUM_JOINTS, 1e-9),
        least_kd=np.zeros(NUM_JOINTS),
    ),
}
"""What stops the robot: measured quantities, of which `range` is position and braking distance, and `sender`, commands
that are far beyond the robot, jump, hang, or hold too little. No stiffness at all stays less than the least: targets of
such motors mean nothing."""
BOUNDS: dict[str, Lift] = {
    "position": lambda limits: replace(limits, lower=-FAR, upper=FAR),
    "slew": lambda limits: replace(limits, slew=FAR),
    "effort": lambda limits: replace(limits, torque_command=FAR),
    "gains": lambda limits: replace(limits, kp_max=1e3, kd_max=1e3, kp_rate=1e6, kd_rate=1e6),
}
"""Bounds to which commands are clipped; `effort` is the predicted torque of a command."""
GROUPS = {NOTHING: (), "stops": tuple(STOPS), "bounds": tuple(BOUNDS)}
"""Names for several of them."""


def lifted(limits: SafetyLimits, names: str) -> SafetyLimits:
    """Return `limits` without those of `names`, e.g. `stops+slew`. Raises ConfigError: there is no such limit."""
    single = STOPS | BOUNDS
    check_known("limit", (*GROUPS, *single), *names.split("+"))
    for name in names.split("+"):
        for each in GROUPS.get(name, (name,)):
            limits = single[each](limits)
    return limits


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

    def __init__(self, options: O | None = None) -> None:
        """Take the options; None are the defaults. Raises ConfigError: one names nothing, or something twice."""
        super().__init__(options)
        for option, names in vars(self.options).items():
            if isinstance(names, tuple) and option != "robot" and len(set(names)) < max(len(names), 1):
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

    def lifts(self, spec: TrialSpec) -> str:
        """Return which limits of the gate are lifted in a trial; see `lifted`."""
        return NOTHING

    def episode(self, spec: TrialSpec) -> Episode:
        """Return the robot of a trial, which is to stand at the height that was asked for."""
        stack = self.trial_stack(spec)
        limits = lifted(SafetyLimits.from_profile(stack.limits), self.lifts(spec))
        episode = Episode(stack, episode_seed(spec.seed, spec.index), self.onlooker, limits)
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
