"""Keeps a robot on a domain moving along paths, through its safety gate, on a thread of its own.

The gate stops a robot that is sent nothing for a tenth of a second, and who checks it must be free to compute.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from golem.errors import GolemError
from golem.evaluation.conformance.robot_rig import Path
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.servo.gains import default_gains
from golem.middleware.dds.domain import DdsConfig
from golem.runtime.bringup.robot_link import PERIOD, RobotLink
from golem.runtime.live.node_setup import member
from golem.types import Array, LowState

RISE = 2.0
"""Time in which the gains rise from nothing [s]."""
SILENT = 5.0
"""How long a state is waited for [s]."""


class Mover:
    """Sends the joints of one robot along paths; the gate has the last word.

    Attributes:
        level: share of the servo's gains that is sent, 0 to 1.
    """

    def __init__(self, dds: DdsConfig) -> None:
        """Hold the joints of the robot on the domain where they are, as soon as the gate lets commands through."""
        self.level = 0.0
        self._dds = dds
        self._job: tuple[Path, float, float] | None = None
        self._done, self._over, self._quiet = threading.Event(), threading.Event(), threading.Event()
        self._states: list[LowState] = []
        self._fault: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="mover", daemon=True)
        self._thread.start()

    def follow(self, path: Path, seconds: float, patience: float) -> list[LowState]:
        """Send the joints along `path` for `seconds` of the robot's time; return its states, from time 0 on.

        Raises:
            GolemError: the robot's time did not pass within `patience` [s].
        """
        self._done.clear()
        self._states = []
        self._job = (path, seconds, -1.0)
        if not self._done.wait(patience) or self._fault is not None:
            raise GolemError(f"The robot's time does not pass: {self._fault or 'it fell silent'}.")
        return self._states

    def fall_silent(self) -> None:
        """Send nothing any more."""
        self._quiet.set()

    def close(self) -> None:
        """End the thread."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            with member("check_mover", self._dds) as (participant, node):
                link = RobotLink(participant, node, self._dds)
                if link.spin(SILENT, lambda: link.state is not None):
                    self._send(link)
        except Exception as error:  # told to whoever waits
            self._fault = error
            self._done.set()

    def _send(self, link: RobotLink) -> None:
        limits, gains = SafetyLimits.from_profile(), default_gains()
        at: Array = np.clip(link.states[-1][1].q, limits.lower, limits.upper)
        last = link.states[-1][1].t
        while not self._over.is_set():
            link.spin(10.0 * PERIOD, _newer(link, last))
            fresh = [state for _, state in link.states if state.t > last]
            for state in fresh:
                at = self._step(state, at)
            if not fresh:
                continue
            last = fresh[-1].t
            if not self._quiet.is_set():
                link.command(at, self.level * gains.kp, np.maximum(self.level * gains.kd, limits.damping))

    def _step(self, state: LowState, at: Array) -> Array:
        """Return where the joints are to be sent in answer to `state`."""
        if self._job is None:
            return at
        path, seconds, begin = self._job
        if begin < 0.0:
            begin = state.t
            self._job = (path, seconds, begin)
        passed = state.t - begin
        self._states.append(replace(state, t=passed))
        at = path(passed)
        if passed >= seconds:
            self._job = None
            self._done.set()
        return at


def _newer(link: RobotLink, last: float) -> Callable[[], bool]:
    return lambda: link.states[-1][1].t > last
