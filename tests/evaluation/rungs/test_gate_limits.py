"""Limits of the gate are lifted one by one, and only where a case says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.rungs.leg_rung import lifted
from golem.evaluation.rungs.push_limit import GateLimits, GateLimitsOptions
from golem.hardware.safety.base import SafetyLimits

STIFF = f"{Path(__file__).parents[1] / 'leg_methods.py'}:Stiff"
GATE = SafetyLimits.from_profile()
FIELDS = tuple(name for name in SafetyLimits.__slots__ if name != "table")
"""All but the table that is derived from them."""


def changed(names: str) -> set[str]:
    limits = lifted(GATE, names)
    return {name for name in FIELDS if not np.array_equal(getattr(limits, name), getattr(GATE, name))}


def test_each_name_lifts_its_own_limits() -> None:
    assert changed("nothing") == set()
    assert changed("speed") == {"velocity"}
    assert changed("range") == {"state_lower", "state_upper"}
    assert changed("effort+slew") == {"torque_command", "slew"}
    assert changed("balance") == {"capture", "sinking", "lean", "low"}
    assert changed("stops") == {
        "velocity", "state_lower", "state_upper", "torque_samples", "tilt", "sane", "jolts", "throw",
        "capture", "sinking", "lean", "low", "hung", "least_kp", "least_kd",
    }  # fmt: skip
    assert changed("bounds") == {
        "lower", "upper", "slew", "torque_command", "kp_max", "kd_max", "kp_rate", "kd_rate"
    }  # fmt: skip
    assert changed("stops+bounds") == changed("stops") | changed("bounds")


def test_an_unknown_limit_is_answered_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="Unknown limit 'sped'.*speed"):
        GateLimits(GateLimitsOptions(lift=("stops+sped",)))


def run(lift: str, level: float) -> TrialOutcome:
    case = {"lift": lift, "phase": "standing", "walk": "0", "direction": "front", "level": level}
    return GateLimits().run(TrialSpec("gate-limits", STIFF, "ideal", 0, 0, case=case), None)


def test_a_robot_that_falls_is_stopped_by_the_gate_unless_that_is_lifted() -> None:
    stopped, later, fallen = run("nothing", 150.0), run("balance", 150.0), run("stops", 150.0)
    assert (stopped.stage, later.stage, fallen.stage) == ("safety", "safety", "fall")
    assert "balance_lost" in stopped.detail and "tilt" in later.detail


def test_the_table_counts_and_names_what_ended_the_others() -> None:
    rung = GateLimits(GateLimitsOptions(phase=("standing",), level=(30.0,), lift=("nothing", "stops")))
    why = "Safety stop at 9.6 s: joint_velocity: left_ankle_pitch_joint at -9.00 rad/s."
    ends = {
        "nothing": (TrialOutcome(True, "done"), TrialOutcome(False, "safety", detail=why)),
        "stops": (TrialOutcome(True, "done"), TrialOutcome(False, "fall", detail="The robot fell at 9.9 s.")),
    }
    case = {"phase": "standing", "walk": "0", "direction": "left", "level": 30.0}
    trials = [
        (TrialSpec("gate-limits", "almi", "bench", 0, i, case={"lift": lift, **case}), outcome)
        for lift, outcomes in ends.items()
        for i, outcome in enumerate(outcomes)
    ]
    (table,) = rung.tables({"almi": trials})
    assert table.rows == (
        ("almi", "standing", "30", "nothing", "1 of 2 [9.45, 90.5]", "joint_velocity ankle_pitch_joint 1"),
        ("almi", "standing", "30", "stops", "1 of 2 [9.45, 90.5]", "fall 1"),
    )
