"""Whoever supervises a simulated robot damps its motors when the gate was killed."""

from __future__ import annotations

from tests.runtime.live.conftest import Live

from golem.hardware.safety.base import SafetyLimits
from golem.runtime.live.launch import Damper


def test_motors_whose_gate_was_killed_are_damped_and_then_limp(live: Live) -> None:
    live.activate()
    live.leave("safety")
    participant, _ = live.member("launch")
    live.run(0.01)
    gains = list[float]()

    def wait(seconds: float) -> bool:
        live.run(seconds)
        motors = live.robot._motors.memory[0]
        gains.append(float(motors["kd"].min()) if not motors["kp"].any() else 0.0)
        return False

    Damper(participant, SafetyLimits.from_profile()).damp(wait)
    assert len(gains) == 1500 and min(gains[5:]) > 0.0
    _, dq, _ = live.robot.joints()
    assert abs(dq).max() < 1.0


def test_it_ends_when_somebody_else_has_the_motors(live: Live) -> None:
    participant, _ = live.member("launch")
    damper = Damper(participant, SafetyLimits.from_profile())
    damper.start()
    damper.stop()
    live.run(0.2)
    assert live.reason != "two_writers"
