"""What motors report of themselves stops the robot once it persists."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.motor_reports import PERSISTENT, MotorReports, MotorWatch
from golem.interfaces.payloads import Reason

WELL = MotorReports(np.ones(27, dtype=bool), np.zeros(27, dtype=np.uint32), np.full((27, 2), 40.0), np.full(27, 58.0))


def ill(field: str, value: Any) -> MotorReports:
    array = getattr(WELL, field).copy()
    array[3] = value
    return replace(WELL, **{field: array})


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("on", False, Reason.MOTOR_MODE),
        ("error", 0x20, Reason.MOTOR),
        ("temperature", 200.0, Reason.MOTOR_HOT),
        ("temperature", -300.0, Reason.MOTOR_HOT),
        ("voltage", 0.0, Reason.MOTOR_VOLTAGE),
        ("voltage", np.nan, Reason.MOTOR_VOLTAGE),
    ],
)
def test_trouble_that_persists_is_a_fault_and_names_the_joint(field: str, value: Any, reason: Reason) -> None:
    watch = MotorWatch(SafetyLimits.from_profile())
    assert watch.add(WELL) is None
    found = [watch.add(ill(field, value)) for _ in range(PERSISTENT)]
    assert found[:-1] == [None] * (PERSISTENT - 1)
    last = found[-1]
    assert last is not None and last.reason is reason and "left_knee_joint" in last.detail
    assert watch.add(WELL) is None


def test_what_a_motor_never_had_it_cannot_lose() -> None:
    watch = MotorWatch(SafetyLimits.from_profile())
    never = replace(WELL, on=np.zeros(27, dtype=bool), voltage=np.zeros(27))
    assert [watch.add(never) for _ in range(20)] == [None] * 20
