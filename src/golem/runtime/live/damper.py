"""Damps the motors of a simulated robot whose safety gate was killed: what supervises the processes does it.

A gate that is killed cannot damp, and drives that hear nothing go limp. On the real robot nobody but the gate writes
to the motors: its own controllers, and the hardware stop, are what is left there.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.gate import passive
from golem.interfaces import public
from golem.middleware.dds.base import Participant
from golem.middleware.ros import names
from golem.middleware.ros.codec import dds_name
from golem.middleware.wire.convert import MODE_MACHINE, encode_low_command
from golem.types import TICK


class Damper:
    """Tells the motors to damp, as long as a stop damps, on a thread of its own."""

    def __init__(self, participant: Participant, limits: SafetyLimits) -> None:
        """Write as a member of a domain, once there is a reason to: a second writer stops a gate."""
        self._participant, self._limits = participant, limits
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Damp from now on."""
        self.stop()
        self._stop.clear()
        self._thread = threading.Thread(target=lambda: self.damp(self._stop.wait), name="damper", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Leave the motors to somebody else."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def damp(self, wait: Callable[[float], bool]) -> None:
        """Damp until the motors may go limp, or until `wait`, given the time between two commands [s], says so."""
        row = public.topic("/lowcmd")
        writer = self._participant.writer(names.topic(row.name), dds_name(row.type), row.qos)
        payload = encode_low_command(passive(0.0, None, self._limits.damping), MODE_MACHINE)
        try:
            for _ in range(round(self._limits.damping_time / TICK)):
                writer.write(payload)
                if wait(TICK):
                    return
        finally:
            writer.close()
