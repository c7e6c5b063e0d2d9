"""Who may move the robot is named unless it is ours."""

from __future__ import annotations

import time

import pytest
from tests.runtime.live.conftest import Live

from golem.hardware.estop.estop_config import VirtualEstop
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces.payloads import GateState
from golem.runtime.live.safety_main import commands
from golem.runtime.live.safety_process import SafetyProcess
from golem.stack import Choice, Stack


@pytest.mark.parametrize(
    ("wire", "name"),
    [
        ("rt/lowcmd", "/lowcmd"),
        ("rt/cmd_vel", "/cmd_vel"),
        ("rt/api/sport/request", "/api/sport/request"),
        ("rq/skill/run/_action/send_goalRequest", "/skill/run/_action/send_goal"),
        ("rq/safety/activateRequest", "/safety/activate"),
        ("rt/lowstate", ""),
        ("rt/api/sport/response", ""),
        ("rr/safety/activateReply", ""),
        ("rq/mine/get_parametersRequest", ""),
        ("DCPSParticipant", ""),
    ],
)
def test_what_moves_the_robot_is_told_from_the_rest(wire: str, name: str) -> None:
    assert commands(wire) == name


def test_the_gate_names_them_while_it_has_no_other_reason() -> None:
    stack = Stack(choices={"robot": Choice("mujoco", {"world": "open"})}, profile="ideal")
    live, strangers = Live(stack), ["python3 (process 7 on lab) (/cmd_vel)"]
    live.start_twin()
    participant, node = live.member("safety")
    limits = SafetyLimits.from_profile().still()
    live.gate = SafetyProcess(
        participant, node, limits, VirtualEstop(), clock=lambda: live.clock, senders=lambda: strangers
    )
    live.gate.step()
    assert live.gate.status.reason is not None and "unknown" not in live.gate.status.detail
    live.run(0.2)
    assert live.gate.status.state is GateState.ARMED
    assert live.gate.status.detail == f"no fault; unknown senders: {strangers[0]}"
    strangers.clear()
    live.run(0.01)
    assert live.gate.status.detail == ""
    live.robot.close()


def test_a_foreign_process_is_found_and_ours_is_not(domain: int) -> None:
    pytest.importorskip("cyclonedds")
    from golem.middleware.dds.connect import connect
    from golem.middleware.dds.domain import DdsConfig
    from golem.runtime.live.exclusive_writers import identity
    from golem.runtime.live.safety_main import unknown_senders

    dds = DdsConfig(domain)
    watch, ours, theirs = connect(dds, identity("safety")), connect(dds, identity("up")), connect(dds, "")
    try:
        for participant in (ours, theirs):
            participant.writer("rt/cmd_vel", "geometry_msgs::msg::dds_::Twist_", qos())
        end = time.monotonic() + 10.0
        while not (found := unknown_senders(watch)) and time.monotonic() < end:
            time.sleep(0.05)
        assert len(found) == 1 and "(/cmd_vel)" in found[0]
    finally:
        for participant in (watch, ours, theirs):
            participant.close()


def qos():  # noqa: ANN201
    """Return what a velocity is sent with."""
    from golem.interfaces import public

    return public.topic("/cmd_vel").qos
