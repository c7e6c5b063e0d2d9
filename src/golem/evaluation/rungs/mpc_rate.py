"""Rung `mpc-rate`: how many plans a second the MPC makes on this machine, by its number of samples."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from golem.capabilities.legs.mpc.controller import MPC, MPCConfig
from golem.errors import ConfigError
from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, episode_seed
from golem.evaluation.rungs.leg_rung import LegRung, PlantOptions, judged
from golem.evaluation.rungs.walking import SETTLE
from golem.evaluation.speed.bench import stopwatch
from golem.options import fill
from golem.stack import Choice

PLANNED = 10.0
"""Time that is counted [s]."""
SAMPLES = (8, 12, 16, 24, 32)
"""Samples per plan."""


class MpcRate(LegRung[PlantOptions]):
    """Stand for 10 s with an MPC of so many samples, and time its plans on this machine.

    In lock-step a plan is there after the latency the controller declares, however long it took: whether it stands
    does not say that the machine is fast enough. It is where 95 of 100 plans are in time: no longer than that latency,
    nor than the time between two plans.
    """

    name = "mpc-rate"
    varied = {"samples": SAMPLES}
    slot = ""  # the MPC alone; `{use: mpc, option: value}` gives it options
    default_methods = ("mpc",)
    default_n = 1
    default_profile = "bench"
    timed = True

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        stack = self.stack(spec.method, spec.profile, spec.overrides)
        legs = stack.choice("lower_body")
        if legs.use != "mpc":
            raise ConfigError('Rung mpc-rate is of the MPC: give --method mpc, or "{use: mpc, option: value}".')
        options = dict(legs.options)
        options["planner"] = {**options.get("planner", {}), "samples": spec.case["samples"]}
        config: MPCConfig = fill("option of lower_body: mpc", MPCConfig, options)
        allowed = min(config.latency, 1.0 / config.plan_rate)
        stack = stack.with_choice("lower_body", Choice("mpc", options))
        with closing(Episode(stack, episode_seed(spec.seed, spec.index), self.onlooker)) as episode:
            with stopwatch(MPC, "plan", time.perf_counter) as wall, stopwatch(MPC, "plan", time.process_time) as cpu:
                episode.stand(SETTLE)
                episode.run(PLANNED)
            outcome = judged(spec.method, episode.loss, {})
            if not wall:
                return outcome
            costs = {
                "plans_per_second": 1.0 / float(np.median(wall)),
                "in_time": float((np.array(wall) <= allowed).mean()),
                "cpu_per_plan": float(np.median(cpu)),
            }
            return replace(outcome, costs=costs)
