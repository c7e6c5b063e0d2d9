"""Judges whoever sends the commands: gains no motor can be held with, torques that go to and fro.

A motor without damping is limp or rings, so a sender that takes it away from one that had it is at fault, whatever else
its command says. What is merely too large is limited, not judged; see `limiter`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.hardware.safety.base import SafetyLimits
from golem.interfaces.payloads import Fault, Reason
from golem.robots.model.table import JOINT_NAMES
from golem.types import NUM_JOINTS, LowCommand

_ZERO = np.zeros(NUM_JOINTS)


@dataclass(frozen=True, slots=True)
class SenderMemory:
    """What is remembered of the commands so far.

    Attributes:
        last: the newest command.
        held: which motors have been held since the activation, all of them or (27,) flags.
        limp: commands in a row that let one of them go, or have a negative gain.
        reversals: level of the reversals of feed-forward torques.
    """

    last: LowCommand | None = None
    held: NDArray[np.bool_] | bool = False
    limp: int = 0
    reversals: float = 0.0


def examine_command(
    new: LowCommand, memory: SenderMemory, limits: SafetyLimits
) -> tuple[SenderMemory, bool, Fault | None]:
    """Judge one new command.

    Args:
        new: one that is finite.
        memory: of the commands before it.
        limits: what to compare with.

    Returns:
        The new memory, whether the command is to be followed, and the fault if one has persisted.
    """
    limp, held, reversals = 0, memory.held, memory.reversals
    # Counting is the quickest question numpy answers.
    count = np.count_nonzero
    if count(new.kd > _ZERO) < NUM_JOINTS or count(new.kp < _ZERO):
        wrong = (new.kd <= 0.0) & held | (new.kp < 0.0) | (new.kd < 0.0)
        limp = memory.limp + 1 if wrong.any() else 0
        held = held | (new.kd > 0.0)
    else:
        wrong, held = None, True
    last = memory.last
    if last is not None:
        if count(new.tau * last.tau < limits.flip):
            reversals += 1.0
        elif reversals:
            reversals = max(0.0, reversals - limits.frame_leak)
    after = SenderMemory(new, held, limp, reversals)
    if wrong is not None and limp >= limits.samples:
        i = int(np.argmax(wrong))
        return (
            after,
            False,
            Fault(Reason.COMMAND_GAINS, f"{JOINT_NAMES[i]} with kp {new.kp[i]:g} and kd {new.kd[i]:g}"),
        )
    if reversals >= limits.reversals and last is not None:
        i = int(np.argmax((new.tau * last.tau) / limits.flip))
        return (
            after,
            False,
            Fault(
                Reason.COMMAND_REVERSALS, f"{JOINT_NAMES[i]} from {last.tau[i]:.0f} to {new.tau[i]:.0f} N m"
            ),
        )
    return after, limp == 0, None
