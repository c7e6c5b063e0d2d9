"""What the stack says of its legs to whoever stands beside the robot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.runtime.live.conftest import BLIND, Live

from golem.interfaces import topics
from golem.interfaces.payloads import GateState, GateStatus
from golem.middleware.bus import Bus
from golem.runtime.live.stack_process import BLIND as PATIENCE
from golem.runtime.live.stack_process import LegsMonitor
from golem.stack import Choice, Stack
from golem.types import BaseEstimate

FAILING = """
from golem.capabilities.legs.hold import JointHold

class Failing(JointHold):
    ticks = 0

    def step(self, state, base, motion, dt):
        self.ticks += 1
        if self.ticks > 50:
            raise ValueError("its knees are weak")
        return super().step(state, base, motion, dt)
"""


def test_a_fallback_that_takes_the_legs_is_said_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.py").write_text(FAILING)
    (tmp_path / "blind.py").write_text(BLIND)
    live = Live(
        Stack(
            {
                "lower_body": Choice(f"{tmp_path / 'mine.py'}:Failing"),
                "localizer": Choice(f"{tmp_path / 'blind.py'}:Blind"),
            }
        )
    )
    live.start_twin()
    live.start_gate()
    live.start_up()
    live.activate()
    capsys.readouterr()
    live.run(3.0)
    assert live.state is GateState.ACTIVE
    said = capsys.readouterr().out
    assert said.count("its knees are weak") == 1 and "'hold' has the legs now" in said
    live.close()


@pytest.mark.parametrize("found", [False, True])
def test_legs_without_an_estimate_are_said_once_per_activation(found: bool) -> None:
    bus, said = Bus(), list[str]()
    watch = LegsMonitor(bus, said.append)

    def look(state: GateState, start: float, seconds: float) -> None:
        for t in start + np.arange(0.0, seconds, LegsMonitor.period):
            bus.publish(topics.SAFETY, GateStatus(float(t), state), float(t))
            # The estimate may be lost later: that stops the robot, and the gate says so.
            fresh = found and t - start < 1.0
            bus.publish(topics.BASE, BaseEstimate(float(t), np.eye(4), stale=not fresh), float(t))
            watch.step(float(t))

    look(GateState.INIT, 0.0, 10.0)
    look(GateState.ACTIVE, 10.0, PATIENCE - 0.2)
    assert not said
    look(GateState.ACTIVE, 13.0, 10.0)
    assert len(said) == (0 if found else 1)
    look(GateState.INIT, 30.0, 1.0)
    look(GateState.ACTIVE, 31.0, 10.0)
    assert len(said) == (0 if found else 2)
