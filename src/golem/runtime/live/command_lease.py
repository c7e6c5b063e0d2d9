"""The lease for the motors' commands: whose commands the gate lets through, and how another process gets there.

It goes to the one that writes when the gate is activated, and ends with that process. While another writes, too, the
robot stops and cannot be activated: one of the two has to end, or an operator hands over on purpose.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping


class CommandLease:
    """Who holds the lease on one topic.

    Attributes:
        holder: guid of the writer whose commands are let through; None before the first activation and after its end.
        ignored: handles of the writers that are heard no more since an operator handed over.
    """

    def __init__(
        self, topic: str, writers: Callable[[], Mapping[int, bytes]], who: Callable[[bytes], str]
    ) -> None:
        """Look after `topic`, whose `writers` are guids by handle; `who` names the owner of one."""
        self._topic, self._writers, self._who = topic, writers, who
        self.holder: bytes | None = None
        self.ignored: frozenset[int] = frozenset()

    def doubt(self, moving: bool) -> str:
        """Return what speaks against letting commands through; empty if nothing does.

        Args:
            moving: whether commands pass now, so that a change of the writer is one nobody asked for.
        """
        present = self._present()
        if len(present) > 1:
            names = ", ".join(map(self._who, present))
            return f"{self._topic} is written by {len(present)}: {names}; end one, or: golem safety hand-over"
        if self.holder is not None and self.holder not in present:
            if moving and present:
                return f"{self._topic} is now written by {self._who(present[0])}, which nobody has activated"
            if not moving:
                self.holder = None
        return ""

    def grant(self) -> None:
        """Give the lease to the one that writes now: the gate was activated."""
        present = self._present()
        self.holder = present[0] if len(present) == 1 else None

    def hand_over(self) -> str:
        """Give the lease to the other of two that write; return whose it is now, or an empty string if nobody's."""
        handles = {guid: handle for handle, guid in self._writers().items() if handle not in self.ignored}
        others = [guid for guid in handles if guid != self.holder]
        if self.holder not in handles or len(others) != 1:
            return ""
        self.ignored |= {handles[self.holder]}
        self.holder = others[0]
        return self._who(self.holder)

    def _present(self) -> list[bytes]:
        writers = self._writers()
        self.ignored &= writers.keys()
        return [guid for handle, guid in writers.items() if handle not in self.ignored]
