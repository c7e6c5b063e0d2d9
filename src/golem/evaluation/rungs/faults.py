"""Rung `faults`: what the safety layer makes of hundreds of faults, hanging, standing and walking."""

from __future__ import annotations

import math
import traceback
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any

from golem.errors import ConfigError, unknown_name
from golem.evaluation.base import DONE, Case, Outcomes, Results, Rung, TrialOutcome, TrialSpec
from golem.evaluation.blame.oracles import with_modules
from golem.evaluation.episodes.episode import episode_seed
from golem.evaluation.faults.catalogue import FAULTS
from golem.evaluation.faults.judge import Judge, verdict
from golem.evaluation.faults.rig import FaultRig
from golem.evaluation.harness.copies import CAN_COPY, in_a_copy
from golem.evaluation.metrics.text_table import TextTable
from golem.interfaces.payloads import GateState
from golem.provenance import stack_facts
from golem.stack import Stack, load_stack
from golem.types import Twist

POSTURES: dict[str, dict[str, Any]] = {
    "hanging": {},
    "standing": {},
    "walking": {},
    "loaded": {"payload": [2.0, 2.0]},
    "climbing": {"world": "slope", "slope": math.radians(8.0)},
}
"""What the robot does when a fault begins, and what differs in its world; loaded: it stands with 2 kg in each hand."""
USUAL = ("hanging", "standing", "walking")
"""Those that are tried unless others are named."""
ARMED = 0.2
"""Time after which the gate is asked to let commands pass [s]."""
SETTLED = {"hanging": 2.5, "standing": 3.5, "walking": 5.5, "loaded": 3.5, "climbing": 11.5}
"""Time at which the fault begins [s]; the ramp begins a metre ahead."""
WALKS = Twist(0.3)
"""What a robot that walks is told, from `SETTLED["standing"]` on."""
BATCH = 20
"""Faults that are tried from one past: as many as a worker gets through within the ladder's limit."""
GATE = "gate"
"""The method: there is one safety layer."""


@dataclass(frozen=True)
class FaultOptions:
    """Which faults, and when."""

    posture: tuple[str, ...] = USUAL
    """What the robot does when they begin: hanging, standing, walking, loaded (2 kg in each hand), climbing (8 deg)."""
    only: str = ""
    """Only faults whose name contains this."""


class FaultsRung(Rung[FaultOptions]):
    """Inject faults into the safety layer at the wire, and have an independent judge look at motors and robot."""

    name = "faults"
    Options = FaultOptions
    provokes = True
    default_methods = (GATE,)
    default_n = 1
    default_profile = "bench"
    adaptive = True

    def __init__(self, options: FaultOptions | None = None) -> None:
        super().__init__(options)
        for posture in self.options.posture:
            if posture not in POSTURES:
                raise unknown_name("posture", posture, POSTURES)
        self.faults = [name for name in FAULTS if self.options.only in name]
        if not self.faults:
            raise ConfigError(f"No fault has '{self.options.only}' in its name; golem faults --help lists none.")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        return {posture: stack_facts(self.stack(posture, profile, overrides)) for posture in self.options.posture}

    def stack(self, posture: str, profile: str, overrides: Mapping[str, str]) -> Stack:
        """Return the stack of a robot in `posture`: one of the shipped, on an open floor."""
        name = "tether" if posture == "hanging" else "stand"
        world = {"world": "open", **POSTURES[posture]}
        return with_modules(load_stack(name, profile=profile).with_options("robot", **world), overrides)

    def cases(self, results: Results) -> Sequence[Case]:
        """Return every fault in every posture."""
        return [{"posture": posture, "fault": name} for posture in self.options.posture for name in self.faults]

    def together(self, spec: TrialSpec) -> Hashable:
        """Return what trials share that have one past."""
        chunk = self.faults.index(str(spec.case["fault"])) // BATCH
        return spec.method, spec.index, spec.case["posture"], chunk

    def run_together(self, specs: Sequence[TrialSpec]) -> Sequence[TrialOutcome]:
        """Bring one robot to the moment of the faults, and go on from there in a copy of the process for each."""
        if len(specs) > 1 and not CAN_COPY:
            return [self.run(spec, None) for spec in specs]
        spec, posture = specs[0], str(specs[0].case["posture"])
        stack = self.stack(posture, spec.profile, spec.overrides)
        with closing(FaultRig(stack, episode_seed(spec.seed, spec.index))) as rig:
            rig.executor.run(ARMED)
            rig.activate()
            walks = posture in ("walking", "climbing")
            rig.executor.run(SETTLED["standing"] if walks else SETTLED[posture])
            if walks:
                rig.twist = WALKS
                rig.executor.run(SETTLED[posture])
            if rig.status.state is not GateState.ACTIVE:
                return [TrialOutcome(False, "settle", detail=rig.status.why) for _ in specs]
            if len(specs) == 1:
                return [_try(rig, spec)]
            return [in_a_copy(partial(_try, rig, each)) for each in specs]

    def tables(self, outcomes: Outcomes) -> Sequence[TextTable]:
        """Return how many faults of each source were dealt with, and every one that was not."""
        trials = [pair for each in outcomes.values() for pair in each]
        rows, lost = list[tuple[str, ...]](), list[tuple[str, ...]]()
        for posture in self.options.posture:
            for source in ("command", "data", "device"):
                mine = [
                    o
                    for s, o in trials
                    if s.case["posture"] == posture and FAULTS[str(s.case["fault"])].source == source
                ]
                stages = Counter(o.stage for o in mine if not o.success)
                ends = ", ".join(f"{stage} {n}" for stage, n in stages.most_common())
                won = sum(o.success for o in mine)
                rows.append((posture, source, f"{won} of {len(mine)}", ends))
        for spec, outcome in trials:
            if not outcome.success:
                lost.append((str(spec.case["posture"]), str(spec.case["fault"]), outcome.stage, outcome.detail))
        return (
            TextTable("Faults the safety layer dealt with", ("robot", "source", "right", "others"), tuple(rows)),
            TextTable("The others", ("robot", "fault", "stage", "what happened"), tuple(lost)),
        )


def _try(rig: FaultRig, spec: TrialSpec) -> TrialOutcome:
    fault, posture = FAULTS[str(spec.case["fault"])], str(spec.case["posture"])
    judge = Judge(rig)
    rig.executor.add(judge)
    rig.begin(fault)
    try:
        rig.executor.run(rig.executor.t + fault.lasting, judge.over)
    except Exception as error:  # whatever a fault makes raise would have ended a process
        return TrialOutcome(
            False, "crash", "safety: gate", f"{type(error).__name__}: {error}", trace=traceback.format_exc()
        )
    found = judge.finding
    stage, detail = verdict(fault, found, posture)
    series = {"speed_share": found.speed, "effort_share": found.effort, "moved": found.moved}
    timings = {} if found.stopped_at is None else {"reaction": found.stopped_at}
    return TrialOutcome(stage == DONE, stage, None if stage == DONE else "safety: gate", detail, timings, series)
