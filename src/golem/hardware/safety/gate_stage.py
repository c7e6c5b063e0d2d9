"""The gate's ordinary tick as a compiled stage: commands pass, limited, and nothing is wrong.

It decides nothing that `gate.check` does not: of an active gate it does the tick in which no check has anything to say,
and leaves every other tick, untouched, to the readable gate. `tests/hardware/safety/test_gate_stage.py` runs both on
the same ticks.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from golem.hardware.safety.base import Counters, Outgoing, SafetyLimits
from golem.hardware.safety.gate_balance import AIRBORNE, BALANCE, balances, carried, sense_balance, unbalanced
from golem.hardware.safety.kernel import ORDINARY as SOUND
from golem.hardware.safety.kernel import UNKNOWN, limited, ordinary_command, rate_state
from golem.hardware.safety.limit_table import LEAST_KP
from golem.hardware.safety.memory import GateMemory
from golem.hardware.safety.sender import LIVELY, SenderMemory
from golem.hardware.safety.senses import CALM, EVERY, FORGET, GRAVITY_TIME, LOOK, LOST, STEADY, SensesMemory
from golem.hardware.safety.senses_kernel import ASKED, GROUPS, SCALARS, looked
from golem.interfaces.payloads import EstopMessage, GateState
from golem.kernels import cfunc, njit
from golem.native import COMMAND, ORDINARY, STAGE, STATE, UNUSUAL, CompiledStage, Record, new_record, shared, view
from golem.native_messages import command_of, put_command, state_of
from golem.types import LEGS, NUM_JOINTS, TICK

_N, _LEGS = NUM_JOINTS, LEGS.stop
_LIMITS = (
    "tilt",
    "jump",
    "future",
    "estop_age",
    "command_late",
    "base_age",
    "stall",
    "longest_tick",
    "frozen",
    "drift",
    "drift_lag",
    "imu_drift",
    "gravity_angle",
    "dead_load",
    "dead_share",
    "dead_time",
    "frame_leak",
    "jolt_leak",
    "hung",
)
"""Limits that the stage compares with and that are one number."""

GATE = np.dtype(
    [
        *((name, "f8") for name in _LIMITS),
        ("gravity", "f8", (2,)),
        ("gravity_moving", "f8", (2,)),
        ("throw", "f8", (3,)),
        ("table", "f8", (27, _N)),
        # What of `GateMemory` changes from one ordinary tick to the next.
        ("t", "f8"),
        ("state_t", "f8"),
        ("state", "f8", (STATE,)),
        ("command_t", "f8"),
        ("command", "f8", (COMMAND,)),
        ("sent", "f8", (COMMAND,)),
        ("outgoing", "f8", (4, _N)),
        ("strained", "i8"),
        ("estop_t", "f8"),
        ("estop_sequence", "i8"),
        ("grounded", "f8"),
        ("prompt", "f8"),
        ("jolts", "f8"),
        ("moved", "f8"),
        ("moves", "i8"),
        # Of `SensesMemory`.
        ("tick", "f8"),
        ("q", "f8", (_N,)),
        ("dq", "f8", (_N,)),
        ("bad", "f8"),
        ("looked", "f8", (STATE,)),
        ("looked_t", "f8"),
        ("looked_at", "f8"),
        ("since", "f8", (GROUPS,)),
        ("drift_now", "f8", (_N,)),
        ("turn", "f8", (3,)),
        ("force", "f8", (3,)),
        ("restless", "f8"),
        ("asked", "f8", (ASKED,)),
        ("dead", "f8", (_N,)),
        ("balance", BALANCE),
    ]
)
"""Limits and memory of the stage."""
_memory_at = view(GATE)


@njit(cache=True)
def pass_command(r: Record, m: Record) -> bool:
    """Do an ordinary tick: write the limited command into the shared record `r`; `m` is a `GATE`.

    Returns:
        Whether the tick was one; if not, nothing was changed.
    """
    t, newest = r.t, r.t + m.future
    # Stamps: of a state and a command that are new, an e-stop and a base that are young enough.
    if not (m.t <= t and t - m.t <= m.stall):
        return False
    if not (m.state_t < r.state_t <= newest and m.command_t < r.request_t <= newest):
        return False
    if not t - r.request_t <= m.command_late:
        return False
    estop_t = m.estop_t
    if r.estop_pressed or not r.estop_t <= newest:
        return False
    if r.estop_t > estop_t and r.estop_sequence != m.estop_sequence:
        estop_t = r.estop_t
    if not t - estop_t <= m.estop_age:
        return False
    grounded = m.grounded
    if not r.stale and r.base_t <= newest and r.base_t > grounded:
        grounded = r.base_t
    if grounded > -math.inf and not t - grounded <= m.base_age:
        return False

    numbers = np.empty(11 * _N)
    for i in range(STATE):
        numbers[i] = r.state[i]
    for i in range(_N):
        numbers[STATE + i] = m.q[i]
    known = rate_state(numbers, m.table, m.jump, math.cos(m.tilt))
    if known == UNKNOWN:
        return False
    if not balances(m.balance):
        return False
    apart, drift = r.state_t - m.tick, np.empty(_N)
    for i in range(_N):
        drift[i] = m.drift_now[i]
        if 0.0 < apart <= STEADY:
            drift[i] = (1.0 - apart / FORGET) * drift[i] + (r.q[i] - m.q[i]) - (0.5 * apart) * (r.dq[i] + m.dq[i])
    looks = not 0.0 <= r.state_t - m.looked_at < LOOK
    if looks:
        out = look(r, m, drift)
        if not plausible(r, m, out):
            return False
    for i in range(COMMAND):
        numbers[i], numbers[COMMAND + i] = r.request[i], m.command[i]
    if not ordinary_command(numbers, m.table, m.throw[0], m.throw[1], m.throw[2]):
        return False
    moved, moves = m.moved, m.moves
    same = True
    for i in range(_LEGS):
        kp, tau = 3 * _N + i, 2 * _N + i
        same = same and r.request[i] == m.command[i] and r.request[kp] == m.command[kp]
        same = same and (r.request[kp] >= m.table[LEAST_KP, i] or r.request[tau] == m.command[tau])
    if not same:
        moves = min(moves + 1, LIVELY) if r.request_t - moved <= 0.5 * m.hung else 0
        moved = r.request_t
    elif m.frozen > 0.0 and moves == LIVELY and r.request_t - moved > m.hung:
        if looks or m.balance.airborne <= AIRBORNE:  # only of feet that carry, which a look may find
            return False

    # From here on the tick is ordinary, and is remembered.
    if looks:
        remember_look(r, m, out)
    if same and m.balance.airborne > AIRBORNE:
        moved = r.request_t
    for i in range(_N):
        numbers[5 * _N + i], numbers[6 * _N + i] = r.q[i], r.dq[i]
        for k in range(4):
            numbers[(7 + k) * _N + i] = m.outgoing[k, i]
        m.q[i], m.dq[i], m.drift_now[i] = r.q[i], r.dq[i], drift[i]
    rows = limited(numbers, m.table, min(t - m.t, m.longest_tick), True, known != SOUND)
    for i in range(_N):
        for k in range(5):
            r.command[k * _N + i] = m.sent[k * _N + i] = rows[k, i]
        for k in range(4):
            m.outgoing[k, i] = rows[5 + k, i]
    for i in range(COMMAND):
        m.command[i] = r.request[i]
    for i in range(STATE):
        m.state[i] = r.state[i]
    if estop_t > m.estop_t:
        m.estop_t, m.estop_sequence = estop_t, r.estop_sequence
    m.t, m.state_t, m.command_t, m.tick = t, r.state_t, r.request_t, r.state_t
    m.grounded, m.prompt, m.strained = grounded, t, known != SOUND
    m.jolts = max(0.0, m.jolts - m.jolt_leak)
    m.bad, m.moved, m.moves = max(0.0, m.bad - m.frame_leak), moved, moves
    r.command_t = t
    return True


@njit(cache=True)
def look(r: Record, m: Record, drift_now: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return what a look at life and plausibility finds; see `senses_kernel.looked`."""
    dt = r.state_t - m.looked_at
    numbers = np.empty(2 * STATE + 2 * _N + ASKED + COMMAND + 6)
    drift, asked = 2 * STATE, 2 * STATE + 2 * _N
    for i in range(STATE):
        numbers[i], numbers[STATE + i] = r.state[i], m.looked[i]
    for i in range(_N):
        numbers[drift + i], numbers[drift + _N + i] = drift_now[i], m.dead[i]
    for i in range(ASKED):
        numbers[asked + i] = m.asked[i]
    for i in range(COMMAND):
        numbers[asked + ASKED + i] = m.sent[i]
    for i in range(3):
        numbers[asked + ASKED + COMMAND + i] = m.turn[i]
        numbers[asked + ASKED + COMMAND + 3 + i] = m.force[i]
    return looked(
        numbers, m.table, dt, 1.0 - dt / FORGET, dt / GRAVITY_TIME, m.drift_lag, m.dead_load, m.dead_share, True
    )


@njit(cache=True)
def plausible(r: Record, m: Record, out: np.ndarray[Any, Any]) -> bool:
    """Return whether a look that found `out` has nothing against the sensors; see `senses`."""
    t = r.state_t
    if not 0.0 < t - m.looked_at < LOST:
        return False
    if m.frozen > 0.0:
        oldest = t
        for g in range(GROUPS):
            since = m.since[g] if out[SCALARS + 9 + g] != 0.0 else t
            oldest = min(oldest, since)
        if t - oldest >= m.frozen - EVERY * TICK - 1e-6:
            return False
    if out[SCALARS + 7] > m.drift or out[SCALARS + 8] >= m.dead_time:
        return False
    x, y, z = out[SCALARS], out[SCALARS + 1], out[SCALARS + 2]
    if not math.sqrt(x * x + y * y + z * z) <= m.imu_drift:
        return False
    x, y, z = out[SCALARS + 3], out[SCALARS + 4], out[SCALARS + 5]
    size = math.sqrt(x * x + y * y + z * z)
    calm = out[SCALARS + 6] <= CALM and t - m.restless >= GRAVITY_TIME
    low = m.gravity[0] if calm else m.gravity_moving[0]
    high = m.gravity[1] if calm else m.gravity_moving[1]
    if not low <= size <= high:
        return False
    if not calm:
        return True
    q = r.quat
    along = 2.0 * (q[1] * q[3] - q[0] * q[2]) * x + 2.0 * (q[2] * q[3] + q[0] * q[1]) * y
    along += (1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])) * z
    return math.acos(max(-1.0, min(1.0, along / size))) <= m.gravity_angle


@njit(cache=True)
def remember_look(r: Record, m: Record, out: np.ndarray[Any, Any]) -> None:
    """Take over what a look found."""
    t = r.state_t
    sense_balance(m.balance, r.q, r.dq, r.tau, r.quat, r.gyro, t - m.looked_at)
    for i in range(_N):
        m.dead[i] = out[_N + i]
    for i in range(ASKED):
        m.asked[i] = out[2 * _N + i]
    for i in range(3):
        m.turn[i], m.force[i] = out[SCALARS + i], out[SCALARS + 3 + i]
    if out[SCALARS + 6] > CALM:
        m.restless = t
    for g in range(GROUPS):
        if out[SCALARS + 9 + g] == 0.0:
            m.since[g] = t
    for i in range(STATE):
        m.looked[i] = r.state[i]
    m.looked_at = m.looked_t = t


def _step(record: int, memory: int) -> int:
    return ORDINARY if pass_command(shared(record), _memory_at(memory)) else UNUSUAL


@cache
def _code() -> Any:
    return cfunc(STAGE, cache=True)(_step)


class GateStage:
    """Carries a gate's memory into the stage, and back. `stage`: the compiled stage."""

    def __init__(self, limits: SafetyLimits) -> None:
        self.stage = CompiledStage(_code(), new_record(GATE))
        memory = self.stage.memory
        for name in (*_LIMITS, "gravity", "gravity_moving", "throw", "table"):
            memory[name] = getattr(limits, name)

    def take(self, gate: GateMemory) -> bool:
        """Take over what `gate` remembers; return whether its next tick may be an ordinary one."""
        senses, sender, outgoing = gate.senses, gate.sender, gate.outgoing
        state, command, estop, sent = gate.state, gate.command, gate.estop, gate.sent
        before, counters = senses.looked, gate.counters
        if gate.mode is not GateState.ACTIVE or gate.reason is not None or sender.refused:
            return False
        if counters not in (Counters(), Counters(strained=True)) or sender.held is not True or not sender.firm:
            return False
        if outgoing is None or outgoing.tau is None or state is None or command is None or estop is None:
            return False
        if sent is None or senses.q is None or senses.dq is None or before is None or senses.force is None:
            return False
        if senses.asked is None or sender.last is not command:
            return False
        memory, row = self.stage.memory, self.stage.memory[0]
        for name in ("t", "prompt"):
            memory[name] = getattr(gate, name)
        for name in ("tick", "q", "dq", "bad", "looked_at", "since", "turn", "force", "restless", "asked"):
            memory[name] = getattr(senses, name)
        memory["balance"], memory["moved"], memory["moves"] = senses.balance, sender.moved, sender.moves
        memory["dead"], memory["drift_now"], memory["jolts"] = senses.dead, senses.drift, sender.jolts
        memory["strained"] = counters.strained
        memory["grounded"] = -math.inf if gate.grounded is None else gate.grounded
        memory["estop_t"], memory["estop_sequence"] = estop.t, estop.sequence
        for name, one in (("state", state), ("looked", before)):
            imu = one.imu
            memory[name + "_t"] = one.t
            memory[name] = np.concatenate((one.q, one.dq, one.tau, imu.quat, imu.gyro, imu.acc))
        memory["command_t"] = command.t
        put_command(row["command"], command)
        put_command(row["sent"], sent)
        memory["outgoing"] = outgoing.q, outgoing.kp, outgoing.kd, outgoing.tau
        return True

    def give_back(self, gate: GateMemory) -> GateMemory:
        """Return what the gate remembers after the ordinary ticks that followed on `gate`."""
        row = self.stage.memory[0]
        command = command_of(row["command"], float(row["command_t"]))
        grounded, t = float(row["grounded"]), float(row["t"])
        balance = self.stage.memory["balance"].copy()
        senses = SensesMemory(
            tick=float(row["tick"]), q=row["q"].copy(), dq=row["dq"].copy(), bad=float(row["bad"]),
            looked=state_of(row["looked"], float(row["looked_t"])), looked_at=float(row["looked_at"]),
            since=tuple(row["since"].tolist()), drift=row["drift_now"].copy(), turn=tuple(row["turn"].tolist()),
            force=tuple(row["force"].tolist()), restless=float(row["restless"]), asked=row["asked"].copy(),
            dead=row["dead"].copy(), balance=balance, carries=carried(balance), unsteady=unbalanced(balance),
        )  # fmt: skip
        return GateMemory(
            t=t, mode=gate.mode, since=gate.since, state=state_of(row["state"], float(row["state_t"])),
            command=command, estop=EstopMessage(float(row["estop_t"]), int(row["estop_sequence"]), False),
            counters=Counters(strained=bool(row["strained"])), outgoing=Outgoing(*row["outgoing"].copy()),
            request=gate.request, grounded=None if grounded == -math.inf else grounded, senses=senses,
            sender=SenderMemory(command, True, 0, float(row["jolts"]), True, float(row["moved"]), int(row["moves"])),
            prompt=float(row["prompt"]), sent=command_of(row["sent"], t), stopped=gate.stopped,
        )  # fmt: skip
