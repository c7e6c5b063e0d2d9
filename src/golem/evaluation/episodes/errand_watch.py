"""What those share who look on while a robot does an errand."""

from __future__ import annotations

import math

from golem.evaluation.episodes.oracle import Oracle
from golem.interfaces import topics
from golem.middleware.bus import News
from golem.robots.mujoco.balance import BalanceRecorder
from golem.runtime.lockstep import LockstepRunner


class ErrandWatch:
    """Looks on after every tick; one of it reads what the skill says, and keeps the decisive picture.

    Attributes:
        recorder: follows the balance; None for a robot that hangs.
        picture: PNG of the decisive moment; None where it has not come.
    """

    def __init__(self, running: LockstepRunner, oracle: Oracle, recorder: BalanceRecorder | None) -> None:
        """Look at what `running` does, through `oracle`."""
        self._running, self._oracle, self.recorder = running, oracle, recorder
        self._news = News(running.bus, topics.FEEDBACK)
        self.picture: bytes | None = None

    def look(self) -> bool:
        """Look on after the errand; it is never a reason to end."""
        if self.recorder is not None:
            self.recorder(self._running.executor.t)
        return False

    def due(self) -> float:
        """Return when it has to look again [s], at the latest."""
        return math.inf if self.recorder is None else self.recorder.due

    def last_picture(self) -> bytes:
        """Return the picture of the decisive moment; else of now."""
        return self.picture or self._oracle.picture()
