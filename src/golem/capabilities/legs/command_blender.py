"""Leads the legs from the commands of one controller to those of the next, so that no target jumps."""

from __future__ import annotations

from golem.interfaces.payloads import LegCommand
from golem.types import Array


class CommandBlender:
    """Mixes the commands of the controller that was in charge with those of the one that is, for a while.

    Attributes:
        active: whether commands are being mixed; if not, `step` changes nothing.
    """

    def __init__(self, duration: float) -> None:
        """Take `duration` [s] from one controller to the next, unless `begin` says otherwise."""
        self._usual = self._duration = duration
        self.reset()

    def reset(self) -> None:
        """Let the next command pass as it is."""
        self.begin(None)

    def begin(self, old: LegCommand | None, duration: float | None = None) -> None:
        """Lead over from the command `old` to those of another controller; None lets them pass as they are."""
        self._old, self._elapsed = old, 0.0
        self.active = old is not None
        self._duration = self._usual if duration is None else duration

    def step(self, command: LegCommand, dt: float, old: LegCommand | None = None) -> LegCommand:
        """Return what the legs are told `dt` [s] after the previous tick instead of `command`.

        Args:
            command: of the controller in charge.
            dt: time since the previous tick [s].
            old: what the one before says now, if it goes on; else the command given to `begin` stays.
        """
        self._elapsed += dt
        if self._old is None or self._elapsed >= self._duration:
            self._old, self.active = None, False
            return command
        return _mixed(old or self._old, command, self._elapsed / self._duration)


def _mixed(old: LegCommand, new: LegCommand, share: float) -> LegCommand:
    """Return the command that is `share` of the way from `old` to `new`."""

    def mix(a: Array, b: Array) -> Array:
        return a + share * (b - a)

    # Without a torque of their own the servo carries the legs; there is nothing in between.
    tau = new.tau if old.tau is None or new.tau is None else mix(old.tau, new.tau)
    return LegCommand(mix(old.q, new.q), mix(old.kp, new.kp), mix(old.kd, new.kd), tau)
