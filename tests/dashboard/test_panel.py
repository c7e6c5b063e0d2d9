"""What the panel says of the safety gate is said in words, and what to do next beside it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from golem.dashboard.panel import _status_html
from golem.dashboard.status import GATE_STATES
from golem.interfaces.payloads import GateState, Reason


def status(state: GateState, reason: str = "") -> Any:
    return SimpleNamespace(t=1.0, safety=state, reason=reason, stage="", text="")


@pytest.mark.parametrize("state", GateState)
def test_every_state_of_the_gate_has_words(state: GateState) -> None:
    html = _status_html(status(state), [], 1.0, "", False, False)
    assert GATE_STATES[state]["meaning"] in html
    assert ("Start over" in html) is state.stopped


def test_a_stop_shows_its_code_and_a_note_of_the_view_goes_first() -> None:
    html = _status_html(status(GateState.STOP1, Reason.ESTOP_PRESSED), [], 1.0, "The robot fell.", False, False)
    assert "stopped: the motors damp" in html and "stop1 estop_pressed" in html
    assert html.index("The robot fell.") < html.index("Start over")
