"""Judges what the motors report of themselves beside their motion: errors, modes, temperatures, voltages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.hardware.safety.base import SafetyLimits
from golem.interfaces.payloads import Fault, Reason
from golem.robots.model.table import JOINT_NAMES
from golem.types import NUM_JOINTS, Array

EVERY = 5
"""States from one look at the reports to the next: none of them moves faster."""
PERSISTENT = 5
"""Level of bad looks that is a fault: each counts one, each good one takes `LEAK` off [own: 50 ms, as long as legs may
be wrong; more than one in ten for long]."""
LEAK = 0.1


@dataclass(frozen=True, slots=True)
class MotorReports:
    """What 27 motors report at one moment.

    Attributes:
        on: (27,) whether each follows commands.
        error: (27,) error words; 0 is none.
        temperature: (27, 2) of casing and winding [degrees].
        voltage: (27,) [V]; 0 from a robot that does not measure it.
    """

    on: NDArray[np.bool_]
    error: NDArray[Any]
    temperature: Array
    voltage: Array


class MotorWatch:
    """Watches the reports of one robot.

    What a motor never had it cannot lose: one that was never on, or never said its voltage, is not judged by that.
    """

    def __init__(self, limits: SafetyLimits) -> None:
        self._limits = limits
        self._was_on = np.zeros(NUM_JOINTS, dtype=bool)
        self._powered = np.zeros(NUM_JOINTS, dtype=bool)
        self._bad = 0.0
        self._forget()

    def _forget(self) -> None:
        self._on, self._error = np.ones(NUM_JOINTS, dtype=bool), np.zeros(NUM_JOINTS, dtype=np.int64)

    def gather(self, reports: MotorReports) -> None:
        """Keep errors and modes of a frame between two looks for the next one."""
        self._on &= reports.on
        self._error |= reports.error.astype(np.int64)

    def add(self, reports: MotorReports) -> Fault | None:
        """Judge new reports, with those gathered; return what is wrong once it has persisted."""
        self.gather(reports)
        fault = self._wrong(MotorReports(self._on, self._error, reports.temperature, reports.voltage))
        self._was_on |= reports.on
        self._powered |= reports.voltage != 0.0
        self._forget()
        self._bad = max(0.0, self._bad - LEAK) if fault is None else min(self._bad + 1.0, PERSISTENT)
        return fault if self._bad >= PERSISTENT and fault is not None else None

    def _wrong(self, reports: MotorReports) -> Fault | None:
        if reports.error.any():
            faulty = np.flatnonzero(reports.error)
            said = ", ".join(f"{JOINT_NAMES[i]} reports error {int(reports.error[i]):#x}" for i in faulty)
            return Fault(Reason.MOTOR, said)
        off = self._was_on & ~reports.on
        if off.any():
            return Fault(Reason.MOTOR_MODE, f"{_first(off)} has switched itself off")
        cold, hot = self._limits.temperature
        outside = np.logical_not(((reports.temperature >= cold) & (reports.temperature <= hot)).all(axis=1))
        if outside.any():
            said = " and ".join(f"{t:g}" for t in reports.temperature[int(np.argmax(outside))])
            return Fault(Reason.MOTOR_HOT, f"{_first(outside)} at {said} degrees")
        low, high = self._limits.voltage
        wrong = self._powered & ~((reports.voltage >= low) & (reports.voltage <= high))
        if wrong.any():
            return Fault(Reason.MOTOR_VOLTAGE, f"{_first(wrong)} at {reports.voltage[int(np.argmax(wrong))]:g} V")
        return None


def _first(which: NDArray[np.bool_]) -> str:
    return JOINT_NAMES[int(np.argmax(which))]
