"""The rung of faults: its judge can fail a gate, and a robot whose stack has gone silent goes on standing."""

from __future__ import annotations

import pytest

from golem.errors import ConfigError
from golem.evaluation.base import TrialSpec
from golem.evaluation.faults.catalogue import FAULTS
from golem.evaluation.faults.rig import Expect, FaultSource, Injection
from golem.evaluation.rungs.faults import FaultFinding, FaultOptions, FaultsRung, verdict
from golem.interfaces.payloads import GateState, Reason

STOP = Injection("x", FaultSource.COMMAND, Expect.STOP, (Reason.COMMAND_STALE,), 0.1, stands=True)
BEAR = Injection("x", FaultSource.DATA, Expect.BEAR)
STOPPED = FaultFinding(0.1, Reason.COMMAND_STALE, "", GateState.STOP2)


def test_there_are_more_than_200_faults_and_names_tell_them_apart() -> None:
    assert len(FAULTS) >= 200


@pytest.mark.parametrize(
    ("fault", "finding", "stage"),
    [
        (STOP, STOPPED, "done"),
        (STOP, FaultFinding(ended=GateState.ACTIVE), "missed"),
        (STOP, FaultFinding(0.2, Reason.COMMAND_STALE), "late"),
        (STOP, FaultFinding(0.1, Reason.TILT), "reason"),
        (STOP, FaultFinding(0.1, Reason.COMMAND_STALE, speed=1.2), "speed"),
        (STOP, FaultFinding(0.1, Reason.COMMAND_STALE, beyond=0.2), "range"),
        (STOP, FaultFinding(0.1, Reason.COMMAND_STALE, fell=True), "fell"),
        (STOP, FaultFinding(0.1, Reason.COMMAND_STALE, unsafe="not finite"), "unsafe"),
        (BEAR, FaultFinding(ended=GateState.ACTIVE), "done"),
        (BEAR, FaultFinding(0.1, Reason.STATE_STALE), "false stop"),
        (BEAR, FaultFinding(ended=GateState.ACTIVE, fell=True), "fell"),
    ],
)
def test_the_judge_names_what_went_wrong(fault: Injection, finding: FaultFinding, stage: str) -> None:
    assert verdict(fault, finding, "standing")[0] == stage


@pytest.mark.slow
def test_a_robot_whose_stack_goes_silent_is_stopped_in_time_and_stands() -> None:
    case = {"posture": "standing", "fault": "silent"}
    outcome = FaultsRung().run(TrialSpec("faults", "gate", "bench", 0, 0, case=case), None)
    assert outcome.success, outcome.detail
    assert "stop2, command_stale" in outcome.detail and outcome.timings["reaction"] <= 0.104


def test_wrong_options_are_answered() -> None:
    with pytest.raises(ConfigError, match="hanging"):
        FaultsRung(FaultOptions(posture=("sitting",)))
    with pytest.raises(ConfigError, match="No fault"):
        FaultsRung(FaultOptions(only="nonsense"))
