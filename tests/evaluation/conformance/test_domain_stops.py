"""What the checks of a stop make of a robot on a domain: here one that exists in numbers only."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from golem.errors import GolemError, ModuleFault
from golem.evaluation.conformance.base import Candidate, Inapplicable
from golem.evaluation.conformance.domain_command import TRIES, DomainStops
from golem.interfaces.payloads import GateState, GateStatus, Reason
from golem.middleware.ros.future import RosError


class Link:
    """States of a robot whose gate stops it `after` what happens [s], for `reason`."""

    def __init__(self, after: float, reason: Reason) -> None:
        self.after, self.reason = after, reason
        self.states: deque[tuple[float, Any]] = deque([(0.0, SimpleNamespace(t=3.0))])
        self.gate: GateStatus | None = None
        self.stopped_at: float | None = None
        self.acted = False

    def spin(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        if self.acted:
            self.states += [(0.0, SimpleNamespace(t=3.0 + self.after)), (0.0, SimpleNamespace(t=2.0))]
            self.gate, self.stopped_at = GateStatus(0.0, GateState.STOP1, self.reason), 0.0
        return until()

    def act(self) -> None:
        self.acted = True

    def call(self, service: str, remedy: str) -> str:
        if self.after < 0.0:
            raise RosError(f"Nobody offers '{service}'; {remedy}.")
        self.acted = True
        return ""


class Stops(DomainStops):
    """The checks of a robot whose strict gate fails to open `failures` times."""

    def __init__(self, after: float, reason: Reason, failures: int = 0, real: bool = False) -> None:
        self.link, self.failures = Link(after, reason), failures
        config = SimpleNamespace(dds=SimpleNamespace(robot=real))
        self.session: Any = SimpleNamespace(
            bench=SimpleNamespace(link=self.link, config=config), guard_strictly=self.guard, rest=lambda _: []
        )

    def guard(self) -> Any:
        self.failures -= 1
        if self.failures >= 0:
            raise GolemError("The gate is not armed: state_stale")
        return SimpleNamespace(fall_silent=self.link.act)


def candidate() -> Candidate:
    return Candidate("robot", "domain 9", lambda: None)


def test_silence_has_to_stop_a_robot_in_the_time_of_the_gates_limits() -> None:
    subject = candidate()
    Stops(0.11, Reason.COMMAND_STALE, failures=TRIES - 1).silence_stops_it(subject)
    assert subject.figures == {"stopped after [s]": pytest.approx(0.11)}
    with pytest.raises(ModuleFault, match=r"stopped after 1\.00 s, later than 0\.2 s"):
        Stops(1.0, Reason.COMMAND_STALE).silence_stops_it(candidate())
    with pytest.raises(ModuleFault, match="gives the reason 'state_stale', not 'command_stale'"):
        Stops(0.11, Reason.STATE_STALE).silence_stops_it(candidate())


def test_where_the_machine_lets_no_strict_gate_open_silence_is_not_judged() -> None:
    with pytest.raises(Inapplicable, match="a strict gate does not let it move: The gate is not armed"):
        Stops(0.11, Reason.COMMAND_STALE, failures=TRIES).silence_stops_it(candidate())


def test_a_jump_of_the_clock_is_asked_of_simulations_that_can() -> None:
    Stops(0.01, Reason.STATE_JUMPED).clock_jump_stops_it(candidate())
    with pytest.raises(Inapplicable, match="clock of a real robot"):
        Stops(0.01, Reason.STATE_JUMPED, real=True).clock_jump_stops_it(candidate())
    with pytest.raises(Inapplicable, match="Nobody offers '/lowstate/jump'"):
        Stops(-1.0, Reason.STATE_JUMPED).clock_jump_stops_it(candidate())
