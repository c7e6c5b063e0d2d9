"""The arms for programs of the vendor's: `/arm_sdk` moves them by its weight, while the stack's own legs go on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from golem.interfaces import topics
from golem.interfaces.unitree_api import ArmSdkCommand
from golem.middleware.bus import Bus, News
from golem.types import ARMS, TICK, LowCommand

RATE = 0.5
"""How fast the weight follows what is asked for [1/s], as xr_teleoperate lets go: 4 rad go by 4 mrad a tick."""
SILENCE = 0.25
"""Time without a command after which the arms go back [s] [own: the examples send one each 20 ms]."""
LET_GO = 1.0
"""Time without a command after which whoever held the arms while they were not to be had has let go [s]."""
NOTHING = 1e-3
"""Weight that asks for nothing."""


class ArmSdk:
    """Blends what a program wants of the arms with what the stack wants, in the motors' command.

    Attributes:
        weight: of the program now, 0 to 1.
    """

    def __init__(self, bus: Bus, closed: Callable[[], bool], tell: Callable[[str], None] = lambda text: None) -> None:
        """Take commands from `bus` unless `closed()`; `tell` says a line to a person."""
        self._news, self._closed, self._tell = News(bus, topics.ARM_SDK), closed, tell
        self._newest: ArmSdkCommand | None = None
        self._heard = self._t = 0.0
        self._held = False
        self.weight = 0.0

    def blend(self, command: LowCommand, t: float) -> LowCommand:
        """Return `command` with the arms as far the program's as it asks for, at robot time `t` [s]."""
        came, dt = self._news.read(), t - self._t
        self._t = t
        if dt < 0.0:  # the robot was restarted
            self._newest, self.weight, dt = None, 0.0, 0.0
        if came is not None:
            self._newest, self._heard = came, t
        silent = t - self._heard
        wanted = 0.0 if self._newest is None or silent > SILENCE else self._newest.weight
        if self._closed():
            self._held, wanted = self._held or wanted > NOTHING, 0.0
        elif wanted <= NOTHING and (silent > LET_GO or (silent <= SILENCE and self._newest is not None)):
            self._held = False
        before, step = self.weight, RATE * min(dt, TICK)
        wanted = 0.0 if self._held else wanted
        self.weight = min(max(wanted, before - step), before + step)
        if self._newest is None or self.weight <= 0.0:
            return command
        if before <= 0.0:
            self._tell("A program of the vendor's has the arms, by /arm_sdk; the legs go on.")
        w, fields = self.weight, {}
        for k, name in enumerate(("q", "dq", "tau", "kp", "kd")):
            values = getattr(command, name).copy()
            values[ARMS] = (1.0 - w) * values[ARMS] + w * self._newest.motors[k]
            fields[name] = values
        return replace(command, **fields)
