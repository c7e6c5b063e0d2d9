"""Rung `faults`: what the safety layer makes of hundreds of faults, hanging, standing and walking.

It shares nothing with the gate but the robot's table of numbers: limits are those of the URDF, motion is the
simulator's truth.
"""

from __future__ import annotations

import math
import traceback
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from golem.errors import ConfigError, check_known
from golem.evaluation.base import DONE, Case, Outcomes, Results, Rung, TrialOutcome, TrialSpec
from golem.evaluation.blame.oracles import with_modules
from golem.evaluation.episodes.episode import episode_seed
from golem.evaluation.faults.catalogue import FAULTS
from golem.evaluation.faults.rig import Expect, FaultRig, FaultSource, Injection
from golem.evaluation.harness.copies import CAN_COPY, in_a_copy
from golem.evaluation.metrics.text_table import TextTable
from golem.interfaces import topics
from golem.interfaces.payloads import GateState, Reason
from golem.provenance import stack_facts
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.stack import Stack, load_stack
from golem.types import TICK, LowCommand, Twist

MARGIN = 1.05
"""How far a measured limit may be exceeded [share]."""
BEYOND = 0.05
"""How far a joint may be beyond its range [rad]: what a joint that leans on its stop gives."""
ASTRAY = 0.1
"""How far a robot that hangs may be moved by a fault the gate bears [rad]."""
LEAST = 0.05
"""Least sum of the gains of a motor that is driven."""
SEEN = 0.3
"""Time after a stop that does not stand from which on nothing more can be learnt [s]."""
KP_MAX, KD_MAX = 500.0, 30.0
"""Bounds of the gains of the authors' firmware."""


@dataclass
class FaultFinding:
    """What was seen of one fault.

    Attributes:
        stopped_at: time from the fault's begin to the gate's stop [s]; None while it goes on.
        speed: greatest true speed of a joint while it was driven, by its limit.
        beyond: greatest distance of a joint from its range while it was driven [rad].
        effort: greatest predicted torque of a command, by the limit.
        moved: greatest distance of a joint from where it was [rad].
        fell: whether the robot lies or hangs in its fall.
        unstopped: whether it was down while commands reached the motors; a gate that is held up lets none through.
        unsafe: what was wrong with a command that reached the motors; empty where nothing was.
    """

    stopped_at: float | None = None
    reason: Reason | None = None
    detail: str = ""
    ended: GateState = GateState.INIT
    speed: float = 0.0
    beyond: float = -math.inf
    effort: float = 0.0
    moved: float = 0.0
    fell: bool = False
    unstopped: bool = False
    unsafe: str = ""


class Judge:
    """Watches a rig from the begin of a fault on; a node that has the last turn of a tick."""

    period = TICK

    def __init__(self, rig: FaultRig) -> None:
        self._rig, self.finding = rig, FaultFinding()
        limits = load_limits("urdf")
        self._velocity, self._torque = limits.velocity, limits.torque
        self._lower, self._upper = limits.lower, limits.upper
        model = rig.robot.scene.model
        self._q = np.array([model.joint(name).qposadr[0] for name in JOINT_NAMES])
        self._v = np.array([model.joint(name).dofadr[0] for name in JOINT_NAMES])
        self._start = rig.robot.data.qpos[self._q].copy()
        self._height = float(rig.robot.data.qpos[2])

    def over(self) -> bool:
        """Return whether nothing more can be learnt: a stop that does not stand is long past."""
        found, fault = self.finding, self._rig.fault
        return (
            found.stopped_at is not None
            and fault is not None
            and not fault.stands
            and found.ended is not GateState.STOP2
            and self._rig.moment.t - found.stopped_at > SEEN
        )

    def step(self, t: float) -> None:
        """Look at one tick."""
        rig, found = self._rig, self.finding
        status, data = rig.status, rig.robot.data
        fault = rig.fault
        harder = status.state is GateState.STOP1 and found.ended is GateState.STOP2
        first = found.stopped_at is None or (harder and fault is not None and fault.expect is Expect.STOP1)
        found.ended = status.state
        if status.stopped and first:
            found.stopped_at = rig.moment.t - TICK
            found.reason, found.detail = status.reason, status.detail
        if rig.told is not None and not found.unsafe:
            found.unsafe = self._unsafe(rig.told, status.state)
        q = data.qpos[self._q]
        if status.state in (GateState.ACTIVE, GateState.STOP2):
            found.speed = max(found.speed, float(np.max(np.abs(data.qvel[self._v]) / self._velocity)))
            found.beyond = max(found.beyond, float(np.max(np.maximum(q - self._upper, self._lower - q))))
            found.moved = max(found.moved, float(np.abs(q - self._start).max()))
        w, x, y, z = data.qpos[3:7]
        tilt = math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))
        fallen = tilt > 1.0 or float(data.qpos[2]) < 0.7 * self._height
        found.unstopped |= fallen and status.state is GateState.ACTIVE and rig.told is not None
        found.fell = found.fell or fallen

    def _unsafe(self, command: LowCommand, state: GateState) -> str:
        """Return what no command to the motors may be; empty if this one is none of it."""
        arrays = (command.q, command.dq, command.tau, command.kp, command.kd)
        if not all(np.isfinite(array).all() for array in arrays):
            return "not finite"
        if command.kp.min() < 0.0 or command.kd.min() < 0.0:
            return "negative gains"
        if command.kp.max() > KP_MAX + 1e-3 or command.kd.max() > KD_MAX + 1e-3:
            return "gains beyond the firmware's"
        if state is GateState.ACTIVE and np.min(command.kp + command.kd) < LEAST:
            return "a motor is limp while active"
        if state is GateState.STOP1 and (command.kp.any() or command.tau.any() or not command.kd.all()):
            return "a stop that does not damp"
        measured = self._rig.bus.latest(topics.LOW_STATE)
        if measured is not None and np.isfinite(measured.q).all() and np.isfinite(measured.dq).all():
            torque = command.kp * (command.q - measured.q) + command.kd * (command.dq - measured.dq) + command.tau
            effort = float(np.max(np.abs(torque) / self._torque))
            if state is not GateState.STOP1:
                self.finding.effort = max(self.finding.effort, effort)
                if effort > MARGIN and self._rig.fault is not None and self._rig.fault.senses is None:
                    return f"{100 * effort:.0f} % of a motor's torque"
        return ""


def verdict(fault: Injection, found: FaultFinding, posture: str) -> tuple[str, str]:
    """Return the stage at which the gate failed under a fault, `"done"` if it did not, and one sentence."""
    what = f"{found.ended}" + (f", {found.reason}: {found.detail}" if found.reason else "")
    if found.unsafe:
        return "unsafe", f"A command reached the motors: {found.unsafe} ({what})."
    if found.unstopped and posture != "hanging":
        return "unsafe", f"The robot fell while commands passed ({what})."
    if fault.expect is Expect.STOP1 and found.ended in (GateState.ACTIVE, GateState.STOP2):
        return "unsafe", f"Motors are driven with it ({what})."
    stops = fault.expect in (Expect.STOP, Expect.STOP1)
    if found.stopped_at is None and stops:
        return "missed", f"It was not noticed; joints moved {found.moved:.2f} rad ({what})."
    if found.stopped_at is not None:
        if fault.expect is Expect.BEAR:
            return "false stop", f"It stopped ({what})."
        # Of two reasons a robot that hangs is stopped for the one that comes first.
        if found.reason not in fault.reasons and not (fault.expect is Expect.STOP1 and posture == "hanging"):
            return "reason", f"It stopped for another reason ({what})."
        if stops and found.stopped_at > fault.within + 1e-9:
            return "late", f"It stopped after {1e3 * found.stopped_at:.0f} ms ({what})."
    if fault.source is FaultSource.COMMAND and found.speed > MARGIN:
        return "speed", f"A joint reached {100 * found.speed:.0f} % of its speed ({what})."
    if fault.source is FaultSource.COMMAND and found.beyond > BEYOND:
        return "range", f"A joint was {found.beyond:.2f} rad beyond its range ({what})."
    if fault.expect is Expect.BEAR and posture == "hanging" and found.moved > ASTRAY:
        return "moved", f"A joint moved {found.moved:.2f} rad ({what})."
    if found.fell and posture != "hanging" and (fault.stands or fault.expect is Expect.BEAR):
        return "fell", f"The robot fell, though legs and state are sound ({what})."
    return "done", f"{what}."


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
        check_known("posture", POSTURES, *self.options.posture)
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
        return [{"posture": posture, "fault": name} for posture in self.options.posture for name in self.faults]

    def together(self, spec: TrialSpec) -> Hashable:
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
        trials = [pair for each in outcomes.values() for pair in each]
        rows: list[tuple[str, ...]] = []
        for posture in self.options.posture:
            for source in ("command", "data", "device"):
                here = [(FAULTS[str(s.case["fault"])], o) for s, o in trials if s.case["posture"] == posture]
                mine = [o for fault, o in here if fault.source == source]
                stages = Counter(o.stage for o in mine if not o.success)
                ends = ", ".join(f"{stage} {n}" for stage, n in stages.most_common())
                won = sum(o.success for o in mine)
                rows.append((posture, source, f"{won} of {len(mine)}", ends))
        lost = tuple(
            (str(s.case["posture"]), str(s.case["fault"]), o.stage, o.detail) for s, o in trials if not o.success
        )
        return (
            TextTable("Faults the safety layer dealt with", ("robot", "source", "right", "others"), tuple(rows)),
            TextTable("The others", ("robot", "fault", "stage", "what happened"), lost),
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
