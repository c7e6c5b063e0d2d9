"""A robot on its feet: the stack lets its band go across the domain, and it stands, also on the vendor's legs."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.runtime.live.conftest import BLIND, Live

from golem.interfaces import topics
from golem.interfaces.payloads import GateState
from golem.stack import load_stack


@pytest.mark.slow
@pytest.mark.parametrize("legs", ["almi", "vendor"])
def test_it_stands_without_its_band(legs: str, tmp_path: Path) -> None:
    (tmp_path / "blind.py").write_text(BLIND)
    stack = load_stack("stand", profile="ideal")
    stack = stack.with_choice("lower_body", legs).with_choice("localizer", f"{tmp_path / 'blind.py'}:Blind")
    live = Live(stack)
    live.start_twin()
    live.start_gate()
    live.start_up()
    live.activate()
    assert live.robot.on_gantry
    live.run(4.0)
    assert not live.robot.on_gantry
    assert live.state is GateState.ACTIVE
    assert live.up is not None and live.up.side is not None
    status = live.up.side.bus.latest(topics.LEG_STATUS)
    assert status is not None and (status.controller, status.fault) == (legs, None)
    assert live.robot.data.qpos[2] > 0.93  # the height of the pelvis [m]
    live.close()
