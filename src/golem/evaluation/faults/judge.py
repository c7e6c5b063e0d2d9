"""Judges what came of a fault: every command that reached the motors, and what the robot really did.

It shares nothing with the gate but the robot's table of numbers: limits are those of the URDF, motion is the
simulator's truth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.evaluation.faults.rig import Expect, FaultRig, FaultSource, Injection
from golem.interfaces import topics
from golem.interfaces.payloads import GateState, Reason
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.types import TICK, LowCommand

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
        reason, detail: why it stopped.
        ended: state of the gate in the end.
        speed: greatest true speed of a joint while it was driven, by its limit.
        beyond: greatest distance of a joint from its range while it was driven [rad].
        effort: greatest predicted torque of a command, by the limit.
        moved: greatest distance of a joint from where it was [rad].
        fell: whether the robot lies or hangs in its fall.
        unstopped: whether it fell while commands passed, or passed again.
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
        """Watch `rig`, whose fault begins now."""
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
        found.unstopped = found.unstopped or (fallen and status.state is GateState.ACTIVE)
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
