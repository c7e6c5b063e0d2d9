"""How a simulated robot and its stack keep step on a machine that is too busy for real time.

The robot's time waits for whoever is behind: for the stack's answer to a state that is `LAG` old, for an image that
takes longer than its camera has. The stack thus reacts as fast as on an idle machine, in the robot's time, and what a
busy machine costs is time by the wall clock. That decides only when to wait no longer: for a process that has died, or
behind a cable that was cut. The safety gate knows nothing but the wall clock, so its patience with a robot whose time
may stand still is longer than the robot's with its stack.
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
SILENCE = 2.0 * PATIENCE
"""Age of state or command at which the gate stops a simulated robot, and at which the stack takes the gate, or the
robot that it works with, for dead [s]."""


def relaxed_limits(limits: SafetyLimits) -> SafetyLimits:
    """Return `limits` for a robot whose time may stand still."""
    base_age = SILENCE + limits.base_age
    return replace(
        limits, state_age=SILENCE, command_age=SILENCE, command_late=SILENCE, base_age=base_age, stall=SILENCE
    )
