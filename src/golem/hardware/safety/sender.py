"""Judges whoever sends the commands: what no motor can be held with, what nobody could mean, torques that jump.

A motor without the least damping is limp or rings, and so is a leg that carries without the least stiffness and without
a feed-forward. A sender that takes it away from one that had it is at fault, whatever else its command says. So is one
whose legs answered the state, and then say the same for ever: on a live state no policy repeats twelve targets. What is
merely too large is limited, not judged (see `limiter`). What is far beyond the robot, or jumps to and fro again and
again, is judged: a limiter keeps the motors within their limits, and not what the ground does to a robot that is thrown
about.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.kernel import SLACK, ordinary_command
from golem.hardware.safety.monitor import whole_command
from golem.interfaces.payloads import Fault, Reason
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, UPPER, Array, LowCommand

LIVELY = 25
"""Changes of the legs' targets after which they are taken to answer the state [own: half a second at 50 Hz]."""
_SHAPES = [(NUM_JOINTS,)] * 5


@dataclass(frozen=True, slots=True)
class SenderMemory:
    """What is remembered of the commands so far.

    Attributes:
        last: the newest command that was followed.
        held: which motors have been held since the activation, all of them or (27,) flags.
        firm: whether legs have been stiff, or fed forward, since the activation.
        refused: commands in a row that were not followed.
        jolts: level of the jumps of torque.
        moved: stamp of the newest command whose legs have other targets than the one before, or are in the air [s].
        moves: how many such there were with no longer a pause than `hung / 2`, at most `LIVELY`.
    """

    last: LowCommand | None = None
    held: NDArray[np.bool_] | bool = False
    refused: int = 0
    jolts: float = 0.0
    firm: bool = False
    moved: float = -np.inf
    moves: int = 0


def examine_command(
    new: LowCommand, memory: SenderMemory, limits: SafetyLimits, carries: bool = False, late: bool = False
) -> tuple[SenderMemory, bool, Fault | None]:
    """Judge one new command.

    Args:
        new: the command, arrays (27,).
        memory: of the commands before it.
        carries: whether feet carry the robot.
        late: whether legs have had their time to become stiff.

    Returns:
        The new memory, whether the command is to be followed, and the fault if it is not finite or one has persisted.
    """
    moved, moves, hung = _answers(new, memory, limits, carries)
    if hung:
        said = f"12 targets of the legs are the same for {(new.t - moved) * 1e3:.0f} ms"
        return memory, False, Fault(Reason.COMMAND_HUNG, said)
    if memory.last is not None and _ordinary(new, memory.last, limits):
        jolts = max(0.0, memory.jolts - limits.jolt_leak) if memory.jolts else 0.0
        return SenderMemory(new, True, 0, jolts, True, moved, moves), True, None
    held, firm, needed = memory.held, memory.firm, limits.samples
    wrong: Fault | None = None
    # Counting is the quickest question numpy answers.
    count = np.count_nonzero
    if not whole_command(new, limits.sane):
        if not whole_command(new):
            return memory, False, Fault(Reason.COMMAND_INVALID)
        wrong = Fault(Reason.COMMAND_BEYOND, _beyond(new, limits))
    else:
        free, soft = ungrasped(new, limits)
        let_go = free & held | (new.kp < 0.0) | (new.kd < 0.0)
        let_go |= soft & (carries and (memory.firm or late))
        if let_go.any():
            i = int(np.argmax(let_go))
            said = f"{JOINT_NAMES[i]} with kp {new.kp[i]:g}, kd {new.kd[i]:g} and tau {new.tau[i]:g}"
            wrong = Fault(Reason.COMMAND_GAINS, said)
        held, firm = held | ~free if count(free) else True, firm or not count(soft)
    if wrong is None and memory.last is not None:
        wrong, needed = _thrown(new, memory.last, limits)
    if wrong is not None:
        refused = memory.refused + 1
        after = SenderMemory(memory.last, held, refused, memory.jolts, firm, moved, moves)
        return after, False, wrong if refused >= needed else None
    last, jolts = memory.last, memory.jolts
    if last is not None:
        jump = np.abs(new.tau - last.tau)
        # Legs that recover from a push ask for targets that jump by nearly all of a motor's torque; arms never do.
        asked = np.abs(_asked_of_legs(new, last)[1])
        jump[LEGS] = np.maximum(jump[LEGS], np.where(asked > limits.throw[0] * limits.torque[LEGS], asked, 0.0))
        arms = new.kp[UPPER] * (new.q[UPPER] - last.q[UPPER]) + (new.tau[UPPER] - last.tau[UPPER])
        jump[UPPER] = np.abs(arms)
        if count(jump > limits.jolt):
            jolts += 1.0
            if jolts >= limits.jolts:
                i = int(np.argmax(jump / limits.jolt))
                wrong = Fault(Reason.COMMAND_JOLTS, f"{JOINT_NAMES[i]} by {jump[i]:.0f} N m")
        elif jolts:
            jolts = max(0.0, jolts - limits.jolt_leak)
    return SenderMemory(new, held, 0, jolts, firm, moved, moves), wrong is None, wrong


def ungrasped(new: LowCommand, limits: SafetyLimits) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which motors have too little damping, and which are soft in a leg without any feed-forward, (27,).

    A feed-forward counts for its whole leg: torques that balance a robot pass through zero at one joint or another.
    """
    soft = new.kp < limits.least_kp
    fed = np.abs(new.tau[LEGS]) > SLACK * limits.torque[LEGS]
    soft[LEGS] &= ~fed.reshape(2, -1).any(axis=1).repeat(len(fed) // 2)
    soft[LEGS.stop :] = False
    return ~(new.kd >= limits.least_kd), soft


def _answers(new: LowCommand, m: SenderMemory, limits: SafetyLimits, carries: bool) -> tuple[float, int, bool]:
    """Return the next `moved` and `moves`, and whether the legs' targets hang.

    Sensors that stand still excuse it. Legs in the air may be told the same for ever: that time does not count.
    """
    if m.last is None or _differs(new, m.last, limits):
        lively = new.t - m.moved <= 0.5 * limits.hung
        return new.t, min(m.moves + 1, LIVELY) if lively else 0, False
    if not carries:
        return new.t, m.moves, False
    return m.moved, m.moves, limits.frozen > 0.0 and m.moves == LIVELY and new.t - m.moved > limits.hung


def _differs(new: LowCommand, last: LowCommand, limits: SafetyLimits) -> bool:
    """Return whether legs are told another thing: a target, a stiffness, or, where that is small, a torque."""
    soft = new.kp[LEGS] < limits.least_kp[LEGS]
    told = (new.q, last.q), (new.kp, last.kp)
    return any((a[LEGS] != b[LEGS]).any() for a, b in told) or bool((soft & (new.tau[LEGS] != last.tau[LEGS])).any())


def _ordinary(new: LowCommand, last: LowCommand, limits: SafetyLimits) -> bool:
    """Return whether there is nothing against `new`, in one call; False says nothing."""
    arrays = new.q, new.dq, new.tau, new.kp, new.kd
    if [getattr(array, "shape", None) for array in arrays] != _SHAPES:
        return False
    numbers = np.concatenate((*arrays, last.q, last.dq, last.tau, last.kp, last.kd), dtype=np.float64)
    return ordinary_command(numbers, limits.table, *limits.throw)


def _thrown(new: LowCommand, last: LowCommand, limits: SafetyLimits) -> tuple[Fault | None, int]:
    """Return what throws the legs, from one command to the next by more than any need, and how many are a fault.

    One motor is given another constant torque by all that it has, or all of them together a torque that is far from
    the last one. Targets of a single motor may be: legs that take a shove ask for that.
    """
    constant, asked = _asked_of_legs(new, last)
    constant, asked = np.abs(constant) / limits.torque[LEGS], np.abs(asked) / limits.torque[LEGS]
    one, constants, together = limits.throw
    if constant.max() > one or constant.sum() > constants:
        i = int(constant.argmax())
        said = f"{JOINT_NAMES[i]} by {constant[i] * limits.torque[i]:.0f} N m"
        return Fault(Reason.COMMAND_JOLTS, said), limits.samples
    if asked.sum() > together:
        said = f"the legs by {asked.sum():.1f} times a motor's torque"
        return Fault(Reason.COMMAND_JOLTS, said), limits.throws
    return None, limits.samples


def _asked_of_legs(new: LowCommand, last: LowCommand) -> tuple[Array, Array]:
    """Return (12,) by how much the constant torque differs, and all that is asked of motors at rest [N m]."""
    q, dq, tau = (getattr(new, name)[LEGS] - getattr(last, name)[LEGS] for name in ("q", "dq", "tau"))
    constant = tau + new.kd[LEGS] * dq
    return constant, constant + new.kp[LEGS] * q


def _beyond(command: LowCommand, limits: SafetyLimits) -> str:
    """Return which number of `command` is the farthest beyond what any sender could mean."""
    numbers = np.concatenate((command.q, command.dq, command.tau, command.kp, command.kd))
    kind, joint = divmod(int(np.argmax(np.abs(numbers) / limits.sane)), NUM_JOINTS)
    return f"{JOINT_NAMES[joint]} with {('q', 'dq', 'tau', 'kp', 'kd')[kind]} {numbers[NUM_JOINTS * kind + joint]:g}"
