"""What the motors are told, from the robot's own wire to the bus of a twin."""

from __future__ import annotations

import time
from collections.abc import Callable

from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.middleware.dds.base import Sample
from golem.middleware.ros.waitset import WaitSet
from golem.middleware.wire.convert import answered, decode_low_command
from golem.middleware.wire.struct_layout import WireError
from golem.runtime.live.rejected import RejectedMessages
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.sim_sync import LAG, PATIENCE
from golem.types import TICK


class CommandIn:
    """Takes what the motors are told, as the robot does: what is damaged or for another machine is ignored.

    The robot's time stands still while an active stack is more than `LAG` behind it: see `golem.runtime.live.sim_sync`.

    Attributes:
        refused: those.
    """

    period = TICK

    def __init__(
        self, bus: Bus, endpoints: RoleEndpoints, tell: Callable[[str], None], patience: float = PATIENCE
    ) -> None:
        """Bring commands to `bus`; `tell` what is refused; wait for one up to `patience` [s] by the wall clock."""
        self._bus, self._patience = bus, patience
        self._t = 0.0
        self._answered = self._given_up = 0.0
        self.refused = RejectedMessages("motor commands", tell)
        self._waitset = WaitSet()
        self._inbox = endpoints.receive("/lowcmd", self._waitset, self._take)

    def step(self, t: float) -> None:
        """Take what has come, and wait for what should have."""
        self._t = t
        self._waitset.poll()
        end = time.monotonic() + self._patience
        while self._late():
            left = end - time.monotonic()
            if left <= 0.0:
                self._given_up = self._answered
                return
            self._waitset.wait(left)
            self._waitset.poll()

    def _late(self) -> bool:
        """Return whether whoever has answered states, and was not given up since, has yet to answer one long past."""
        answered = self._answered
        return answered not in (0.0, self._given_up) and self._t - answered > LAG + TICK / 2.0

    def _take(self, sample: Sample) -> None:
        try:
            command = decode_low_command(sample.payload, self._t)
            self._answered = answered(sample.payload)
        except WireError as error:
            self.refused.add(error)
            return
        self._bus.publish(topics.LOW_CMD, command, self._t)
