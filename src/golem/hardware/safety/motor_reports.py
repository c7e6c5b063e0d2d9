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
"""Looks in a row that show the same kind of trouble before it is a fault [own: 50 ms, as long as legs may be wrong]."""


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
        """Compare with `limits`."""
        self._limits = limits
        self._was_on = np.zeros(NUM_JOINTS, dtype=bool)
        self._powered = np.zeros(NUM_JOINTS, dtype=bool)
        self._bad = 0

    def add(self, reports: MotorReports) -> Fault | None:
        """Judge new reports; return what is wrong once it has persisted."""
        fault = self._wrong(reports)
        self._was_on |= reports.on
        self._powered |= reports.voltage != 0.0
        self._bad = 0 if fault is None else self._bad + 1
        return fault if self._bad >= PERSISTENT else None

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
            return Fault(
                Reason.MOTOR_VOLTAGE, f"{_first(wrong)} at {reports.voltage[int(np.argmax(wrong))]:g} V"
            )
        return None


def _first(which: NDArray[np.bool_]) -> str:
    return JOINT_NAMES[int(np.argmax(which))]
