"""`golem drivers estop`: listens to the e-stop board without a gate, for the first wiring and the press before work."""

from __future__ import annotations

import math
import time
from contextlib import closing
from dataclasses import dataclass

from tyro.conf import Positional

from golem.hardware.estop.serial_board import SerialEstop
from golem.interfaces.payloads import EstopMessage
from golem.middleware.interrupt import interrupted
from golem.runtime.live.node_setup import log_line
from golem.types import TICK


@dataclass(frozen=True)
class EstopCheckConfig:
    """Say what the e-stop board says, until Ctrl-C: press the button, release it, pull its wire and its plug."""

    port: Positional[str]
    """Its serial port, e.g. /dev/ttyACM0."""


class EstopReport:
    """What an e-stop has said since it was listened to."""

    def __init__(self) -> None:
        self.pressed = self.released = False
        self._said = ""
        self._frames = 0
        self._since = self._newest = math.nan
        self._longest = 0.0

    def add(self, t: float, frame: EstopMessage | None, fault: str) -> str:
        """Take in what came at `t` [s]; return what is to be told, empty for nothing new."""
        if frame is not None:
            self._longest = max(self._longest, t - self._newest) if self._frames else 0.0
            self._since = self._since if self._frames else t
            self._newest = t
            self._frames += 1
            self.pressed |= frame.pressed
            self.released |= not frame.pressed
        now = fault or self._said if frame is None else "pressed" if frame.pressed else "released"
        news, self._said = now if now != self._said else "", now
        return news

    def summary(self, estop: SerialEstop) -> str:
        """Return what was heard in all."""
        if self._frames < 2:
            return "No frame came."
        rate = (self._frames - 1) / (self._newest - self._since)
        return (
            f"{self._frames} frames, {rate:.1f} per second, longest pause {self._longest * 1e3:.0f} ms; "
            f"{estop.lost} lost, {estop.late} late, {estop.skipped} bytes without a frame."
        )


def run_estop_check(config: EstopCheckConfig) -> bool:
    """Listen until Ctrl-C; return whether it was pressed and released. Raises MissingExtra, PortError: no port."""
    report = EstopReport()
    with closing(SerialEstop(config.port)) as estop, interrupted() as stop:
        while not stop.wait(TICK):
            t = time.monotonic()
            news = report.add(t, estop.step(t), estop.fault)
            if news:
                log_line(news)
        log_line(report.summary(estop))
    return report.pressed and report.released
