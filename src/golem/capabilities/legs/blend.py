"""Leads the legs from the commands of one controller to those of the next, so that no target jumps."""

from __future__ import annotations

from golem.capabilities.legs.base import LegCommand
from golem.types import Array


class Blend:
    """Mixes the last command of the controller that was in charge with those of the one that is, for a while."""

    def __init__(self, duration: float) -> None:
        """Take `duration` [s] from one controller to the next."""
        self._duration = duration
        self.reset()

    def reset(self) -> None:
        """Forget what was commanded: the next command passes as it is."""
        self._last: LegCommand | None = None
        self._old: LegCommand | None = None
        self._elapsed = 0.0

    def begin(self) -> None:
        """Lead over from the newest command, if there was one: from now on the commands are another controller's."""
        self._old, self._elapsed = self._last, 0.0

    def step(self, command: LegCommand, dt: float) -> LegCommand:
        """Return what the legs are told `dt` [s] after the previous tick instead of `command`."""
        self._elapsed += dt
        if self._old is not None and self._elapsed < self._duration:
            command = _mixed(self._old, command, self._elapsed / self._duration)
        else:
            self._old = None
        self._last = command
        return command


def _mixed(old: LegCommand, new: LegCommand, share: float) -> LegCommand:
    """Return the command that is `share` of the way from `old` to `new`."""

    def mix(a: Array, b: Array) -> Array:
        return a + share * (b - a)

    # Without a torque of their own the servo carries the legs; there is nothing in between.
    tau = new.tau if old.tau is None or new.tau is None else mix(old.tau, new.tau)
    return LegCommand(mix(old.q, new.q), mix(old.kp, new.kp), mix(old.kd, new.kd), tau)
