"""How a simulated robot and its stack keep step on a machine that is too busy for real time.

The robot's time waits for whoever is behind: for the stack's answer to a state that is `LAG` old, for an image that
takes longer than its camera has. The stack thus reacts as fast as on an idle machine, and what a busy machine costs is
time by the wall clock. That decides only when to wait no longer: for a process that has died, or behind a cable that
was cut. The safety gate knows nothing but the wall clock, so its patience is longer than the robot's with its stack.
"""

from __future__ import annotations

from dataclasses import replace

from golem.hardware.safety.base import SafetyLimits
from golem.types import TICK

CATCH_UP = 5
"""Ticks that a stack makes up for when states were late or lost; more are left out [own]."""
LAG = CATCH_UP * TICK
"""How old a state may be that the stack has not answered yet [s]: one that is further behind would leave ticks out."""
PATIENCE = 1.0
"""How long the robot's time stands still for an answer or an image at most [s] [own: with two cores for three times as
many busy threads, processes were held up for 0.6 s]."""
SILENCE = 3.0 * PATIENCE
"""Time without a word after which the stack takes the gate, or the robot that it works with, for dead [s]."""
_AGES = ("state_age", "command_age", "command_late", "base_age", "stall", "hung")


def relaxed_limits(limits: SafetyLimits) -> SafetyLimits:
    """Return `limits` for a robot whose time may stand still.

    Each age grows by `SILENCE`, so what comes first stays first: of a robot that is gone, the state is missed and not
    the command, which answers an older state.
    """
    return replace(limits, **{age: SILENCE + getattr(limits, age) for age in _AGES})
