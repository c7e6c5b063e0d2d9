"""The safety gate: a pure function between every motion command and the motors. Whatever is missing stops it.

    INIT   something is missing; limp           -> ARMED  once state and e-stop are sound
    ARMED  sound; damps                         -> ACTIVE or STOP1 on request, INIT when no longer sound
    ACTIVE commands pass, limited               -> STOP2  on a fault that leaves state and legs sound
                                                -> STOP1  on any other
    STOP2  a controller of the gate stands      -> STOP1  when it cannot, or a stop is asked for; ACTIVE: see below
    STOP1  damps                                -> STOP0  after 3 s, ARMED on reset
    STOP0  limp                                 -> ARMED  on reset

A stop is latched with its reason. Reset needs everything sound, the button released, a robot that is upright and at
rest, a second since the stop, and an explicit request; it leads to ARMED, never back to motion. What activates is a
command that holds every motor near where it is. ACTIVE and STOP2 pass the same checks, by the same memory. A robot that
stands in STOP2 would fall in ARMED: there a reset only takes the reason away, and a robot without a reason can be
activated again. A command that is not finite stops the robot; one beyond a limit is limited.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from golem.hardware.safety.base import Counters, GateInputs, OperatorRequest, Outgoing, SafetyLimits
from golem.hardware.safety.limiter import limit_command
from golem.hardware.safety.memory import GateMemory, GateResult
from golem.hardware.safety.monitor import examine, quickly, whole, whole_command
from golem.hardware.safety.sender import SenderMemory, examine_command, ungrasped
from golem.hardware.safety.senses import EVERY, SensesMemory, sense
from golem.interfaces.payloads import EstopMessage, Fault, GateState, Reason
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, TICK, Array, BaseEstimate, Imu, LowCommand, LowState

STANDING_AGE = 0.010
"""Time in which a standing controller has to have the legs once a stop has given them to it [s]."""
STAND = frozenset(
    {
        Reason.COMMAND_DAMAGED,
        Reason.COMMAND_MISSING,
        Reason.COMMAND_STALE,
        Reason.COMMAND_TIME,
        Reason.COMMAND_INVALID,
        Reason.COMMAND_UNSTAMPED,
        Reason.COMMAND_GAINS,
        Reason.COMMAND_JOLTS,
        Reason.COMMAND_BEYOND,
        Reason.COMMAND_HUNG,
        Reason.BALANCE,
        Reason.BASE_STALE,
    }
)
"""Reasons that say nothing against state and legs."""


def check(inputs: GateInputs, limits: SafetyLimits, memory: GateMemory) -> GateResult:
    """Decide what the motors are told at this tick.

    Args:
        inputs: time, newest frames, request. Frames that repeat or arrive out of order are recognised by their
            stamps (and sequence) and never refresh an age; a frame that says "pressed" counts however late it is.
        memory: that of the previous result; `GateMemory()` at the start.

    Returns:
        The command and the state, with the memory for the next call. Never raises for what frames contain.
    """
    running = math.isfinite(inputs.t) and inputs.t >= memory.t
    t = inputs.t if running else memory.t if math.isfinite(memory.t) else 0.0
    estop, estop_fault = _estop(inputs.estop, memory.estop, t, limits)
    state, counters, senses, state_fault = _state(inputs, memory, t, limits)
    stands_up = senses.carries
    command, sender, prompt, command_fault = _command(inputs.command, memory, t, limits, stands_up)
    grounded, base_fault = _base(inputs.base, memory, t, limits)
    clock_fault = None if running else Fault(Reason.CLOCK)
    faults = [clock_fault, _pause(memory, t, limits), *inputs.transport, estop_fault, state_fault]
    fault = _strictest(faults)
    edge = inputs.request if inputs.request is not memory.request else OperatorRequest.NONE

    mode, reason, detail, since = memory.mode, memory.reason, memory.detail, memory.since
    outgoing, stopped = memory.outgoing, memory.stopped
    if mode is GateState.ACTIVE:
        requested = Fault(Reason.REQUESTED) if inputs.request is OperatorRequest.STOP else None
        faults += [command_fault, base_fault, memory.senses.unsteady, requested]
        fault = _strictest(faults)
        if fault is not None:
            stands = inputs.stands and stands_up and all(map(_stands, faults))
            mode = GateState.STOP2 if stands else GateState.STOP1
            reason, detail, since = fault.reason, fault.detail, t
    elif mode is GateState.STOP2:
        asked = Fault(Reason.REQUESTED) if inputs.request is OperatorRequest.STOP else None
        faults = [asked, *faults, _standing(inputs, since, limits), memory.senses.unsteady]
        hard = next((f for f in faults if not _stands(f)), None)
        fault = fault or command_fault or memory.senses.unsteady
        if hard is not None:
            mode, since, reason, detail = GateState.STOP1, t, hard.reason, hard.detail
        elif edge is OperatorRequest.RESET and fault is None and _rests(state, t - since, limits):
            reason, detail = None, ""
        elif edge is OperatorRequest.ACTIVATE and reason is None and state is not None:
            fault = fault or _opens(command, state, limits)
            if fault is None:
                mode, since = GateState.ACTIVE, t
            else:
                detail = f"not activated: {fault.detail or fault.reason}"
    elif mode.stopped:
        if edge is OperatorRequest.RESET and fault is None and _rests(state, t - stopped, limits):
            mode, reason, detail, since = GateState.ARMED, None, "", t
        elif mode is GateState.STOP1 and t - since >= limits.damping_time:
            mode, since = GateState.STOP0, t
    else:
        reason, detail = (None, "") if fault is None else (fault.reason, fault.detail)
        new = GateState.ARMED if fault is None else GateState.INIT
        if new is GateState.ARMED and inputs.request is OperatorRequest.STOP:
            new, reason = GateState.STOP1, Reason.REQUESTED  # who activates later may not know why it was asked for
        elif new is GateState.ARMED and edge is OperatorRequest.ACTIVATE:
            refused = command_fault or (None if state is None else _opens(command, state, limits))
            if refused is not None:
                reason, detail = refused.reason, refused.detail
            elif state is not None:
                new = GateState.ACTIVE
                outgoing = Outgoing(state.q.astype(np.float64), np.zeros(NUM_JOINTS), limits.damping)
        if new is not mode:
            mode, since = new, t
    if mode.stopped and mode is not memory.mode and mode is not GateState.STOP0:
        stopped = t

    wanted = {GateState.ACTIVE: command, GateState.STOP2: inputs.standing}.get(mode)
    if state is not None and wanted is not None and outgoing is not None:
        dt = min(t - memory.t, limits.longest_tick)
        sent, outgoing = limit_command(t, state, wanted, limits, outgoing, dt, counters.strained)
    else:
        if mode is not GateState.STOP2:
            outgoing = None
        damps = mode in (GateState.ARMED, GateState.STOP1, GateState.STOP2)
        sent = passive(t, state, limits.damping if damps else np.zeros(NUM_JOINTS))
    return GateResult(
        command=sent,
        state=mode,
        reason=reason,
        detail=detail,
        memory=GateMemory(
            t=t,
            mode=mode,
            since=since,
            reason=reason,
            detail=detail,
            state=state,
            command=command,
            estop=estop,
            counters=counters,
            outgoing=outgoing,
            request=inputs.request,
            grounded=grounded,
            senses=senses,
            sender=sender,
            prompt=prompt,
            sent=sent,
            stopped=stopped,
        ),
    )


def passive(t: float, state: LowState | None, damping: Array) -> LowCommand:
    """Return the command that only damps with `damping` (27,) [N m s/rad]; with zeros the motors are limp."""
    zeros = np.zeros((4, NUM_JOINTS))
    q = zeros[0] if state is None else state.q.astype(np.float64)
    return LowCommand(t=t, q=q, dq=zeros[1], tau=zeros[2], kp=zeros[3], kd=damping.copy())


class Gate:
    """The gate with its memory, for whoever runs one.

    Attributes:
        limits: what it compares with.
        memory: what it remembers; assign `GateMemory()` for a new episode.
    """

    def __init__(self, limits: SafetyLimits | None = None) -> None:
        """Start as a gate that has seen nothing, with the default profile's limits if none are given."""
        self.limits = limits or SafetyLimits.from_profile()
        self.memory = GateMemory()

    def prepare(self) -> None:
        """Load what is compiled now, or compile it: where the wall clock counts, no tick must wait for it."""
        memory, still = GateMemory(), np.zeros(NUM_JOINTS)
        hold = np.full(NUM_JOINTS, 100.0)
        imu = Imu(np.eye(4)[0], np.zeros(3), np.array([0.0, 0.0, 9.81]))
        for i in range(2 * EVERY + 1):
            t = i * TICK
            frames = LowState(t, still, still, still, imu), LowCommand(t, still, still, still, hold, hold)
            estop, request = EstopMessage(t, i, False), OperatorRequest.ACTIVATE
            memory = check(GateInputs(t, *frames, estop, request), self.limits.still(), memory).memory

    def step(self, inputs: GateInputs) -> GateResult:
        """Run `check` and keep its memory."""
        result = check(inputs, self.limits, self.memory)
        self.memory = result.memory
        return result


def _strictest(faults: list[Fault | None]) -> Fault | None:
    """Return the first fault in spite of which nobody stands, or else the first; what else is missing before HELD."""
    known = sorted((fault for fault in faults if fault is not None), key=lambda fault: fault.reason is Reason.HELD)
    return next((fault for fault in known if not _stands(fault)), known[0] if known else None)


def _standing(inputs: GateInputs, since: float, limits: SafetyLimits) -> Fault | None:
    """Say what is wrong with the standing controller, which has had the time to take the legs."""
    told = inputs.standing
    if told is None:
        late = inputs.t > since + STANDING_AGE
        return Fault(Reason.STANDING, "it gives no command") if late else None
    if not whole_command(told, limits.sane):
        return Fault(Reason.STANDING, "its command is not finite, or beyond the robot")
    free, soft = ungrasped(told, limits)
    return Fault(Reason.STANDING, "it lets go of the legs") if (free | soft)[LEGS].any() else None


def _rests(state: LowState | None, since: float, limits: SafetyLimits) -> bool:
    """Return whether a robot that stopped `since` ago is at rest."""
    if state is None or since < limits.reset_after:
        return False
    turning, moving = limits.at_rest
    return bool(np.abs(state.imu.gyro).max() <= turning and np.abs(state.dq).max() <= moving)


def _opens(command: LowCommand | None, state: LowState, limits: SafetyLimits) -> Fault | None:
    """Say what speaks against letting `command` drive a robot in `state` that damps, or stands by the gate."""
    if command is None:
        return Fault(Reason.COMMAND_MISSING)
    free, away = ungrasped(command, limits)[0], np.abs(command.q - state.q)
    away[command.kp < limits.least_kp] = 0.0
    asked = command.kp * (command.q - state.q) + command.kd * (command.dq - state.dq) + command.tau - state.tau
    asked[LEGS] = 0.0  # their targets are torques: what they need depends on who carries the robot until now
    thrown = np.abs(asked) / limits.torque
    far, much = limits.opening
    for bad, text in (
        (free, "is not held"),
        (away > far, f"would go {away.max():.2f} rad"),
        (thrown > much, f"would get {thrown.max():.1f} times its torque at once"),
    ):
        if bad.any():
            return Fault(Reason.COMMAND_AWAY, f"{JOINT_NAMES[int(np.argmax(bad))]} {text}")
    return None


def _stands(fault: Fault | None) -> bool:
    """Return whether a robot can stand in spite of `fault`."""
    return fault is None or fault.stands or fault.reason in STAND


def _stamped(t_frame: float, t: float, limits: SafetyLimits) -> bool:
    return t_frame <= t + limits.future  # false for nan


def _pause(memory: GateMemory, t: float, limits: SafetyLimits) -> Fault | None:
    pause = t - memory.t
    if memory.mode in (GateState.ACTIVE, GateState.STOP2) and pause > limits.stall:
        return Fault(Reason.STALLED, f"for {pause * 1e3:.0f} ms")
    return None


def _estop(
    new: EstopMessage | None, old: EstopMessage | None, t: float, limits: SafetyLimits
) -> tuple[EstopMessage | None, Fault | None]:
    if new is not None:
        if new.pressed:
            return (new if _stamped(new.t, t, limits) else old), Fault(Reason.ESTOP_PRESSED)
        if not _stamped(new.t, t, limits):
            return old, Fault(Reason.ESTOP_TIME, f"stamp {new.t} at {t}")
        if old is None or (new.t > old.t and new.sequence != old.sequence):
            old = new
    if old is None:
        return None, Fault(Reason.ESTOP_MISSING)
    if old.pressed:
        return old, Fault(Reason.ESTOP_PRESSED)
    if t - old.t > limits.estop_age:
        return old, Fault(Reason.ESTOP_STALE, f"{(t - old.t) * 1e3:.0f} ms old")
    return old, None


def _state(
    inputs: GateInputs, memory: GateMemory, t: float, limits: SafetyLimits
) -> tuple[LowState | None, Counters, SensesMemory, Fault | None]:
    known, senses, faults = memory.state, memory.senses, list[Fault | None]()
    counters, driven = memory.counters, memory.mode in (GateState.ACTIVE, GateState.STOP2)
    newest = (inputs.tick, inputs.state)
    sent = memory.sent if driven else None
    for tick, state in (*inputs.earlier, newest):
        known, counters, senses, fault = _sample(state, tick, (known, counters, senses), sent, t, limits)
        faults.append(fault)
    return known, counters, senses, _strictest(faults)


def _sample(
    new: LowState | None,
    tick: float | None,
    before: tuple[LowState | None, Counters, SensesMemory],
    sent: LowCommand | None,
    t: float,
    limits: SafetyLimits,
) -> tuple[LowState | None, Counters, SensesMemory, Fault | None]:
    """Judge one sample that arrived; `sent` is what drives the motors."""
    old, counters, senses = before
    if new is not None:
        if not _stamped(new.t, t, limits):
            return old, counters, senses, Fault(Reason.STATE_TIME, f"stamp {new.t} at {t}")
        # Of states that were taken from the network at once the robot's own time tells which is newer.
        fresh = old is None or new.t > old.t or (new.t == old.t and tick is not None and tick > senses.tick)
        was = senses.q
        known = quickly(new, was, limits, limits.jump) if fresh and was is not None else None
        if known is None and new is not old and not whole(new):
            return old, counters, senses, Fault(Reason.STATE_INVALID)
        if fresh:
            at = new.t if tick is None else tick
            senses, believed, odd = sense(new, at, senses, limits, sent, smooth=known is not None)
            if believed:
                counters, fault = (known, None) if known is not None else examine(new, limits, counters)
                if fault is not None:
                    return new, counters, senses, fault
                old = new
            if odd is not None:
                return old, counters, senses, odd
    if old is None:
        return None, counters, senses, Fault(Reason.STATE_MISSING)
    if t - old.t > limits.state_age:
        return old, counters, senses, Fault(Reason.STATE_STALE, f"{(t - old.t) * 1e3:.0f} ms old")
    return old, counters, senses, None


def _base(
    new: BaseEstimate | None, memory: GateMemory, t: float, limits: SafetyLimits
) -> tuple[float | None, Fault | None]:
    if memory.mode is not GateState.ACTIVE:
        return None, None
    old = memory.grounded
    if new is not None and not new.stale and _stamped(new.t, t, limits) and (old is None or new.t > old):
        old = new.t
    if old is not None and t - old > limits.base_age:
        return old, Fault(Reason.BASE_STALE, f"for {(t - old) * 1e3:.0f} ms")
    return old, None


def _command(
    new: LowCommand | None, memory: GateMemory, t: float, limits: SafetyLimits, carries: bool
) -> tuple[LowCommand | None, SenderMemory, float, Fault | None]:
    old, active = memory.command, memory.mode is GateState.ACTIVE
    sender, prompt = memory.sender, memory.prompt if active else t
    if new is not None:
        if not _stamped(new.t, t, limits):
            return old, sender, prompt, Fault(Reason.COMMAND_TIME, f"stamp {new.t} at {t}")
        if old is None or new.t > old.t:
            late = active and t - memory.since > limits.grace
            sender, followed, fault = examine_command(new, sender if active else SenderMemory(), limits, carries, late)
            if fault is not None:
                return (old if fault.reason is Reason.COMMAND_INVALID else new), sender, prompt, fault
            old = new if followed or old is None else replace(old, t=new.t)
    if old is None:
        return None, sender, prompt, Fault(Reason.COMMAND_MISSING)
    age = t - old.t
    if age <= limits.command_late:
        prompt = t
    if age > limits.command_age or t - prompt > limits.command_age:
        return old, sender, prompt, Fault(Reason.COMMAND_STALE, f"{age * 1e3:.0f} ms old")
    return old, sender, prompt, None
