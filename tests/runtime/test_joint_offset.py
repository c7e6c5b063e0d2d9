"""Calibrated zeros are taken off what the encoders report, and put on what the motors are told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.sensors.calibration import Calibration
from golem.runtime.contract_check import ContractCheck
from golem.runtime.robot_nodes import ActNode, SenseNode
from golem.stack import Stack, parse_stack
from golem.types import NUM_JOINTS, HandState, Imu, LowCommand


class Still:
    """A robot whose joints are where they are, and which remembers what it was told."""

    def __init__(self) -> None:
        self.told: LowCommand | None = None
        self.q = np.linspace(-0.2, 0.2, NUM_JOINTS)

    def joints(self) -> Any:
        return self.q, np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)

    def imu(self) -> Imu:
        return Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))

    def hand(self, side: str, t: float) -> HandState:
        return HandState(t, 0.05, np.full(2, 0.025), np.zeros(2))

    def advance(self, command: LowCommand, hands: Any, dt: float) -> None:
        self.told = command


@pytest.mark.parametrize("offset", [None, 0.03 * np.ones(NUM_JOINTS)])
def test_what_is_sent_to_where_the_joints_are_is_what_they_report(offset: Any) -> None:
    bus, robot = Bus(), Still()
    contract = ContractCheck("robot", "still")
    sense, act = (kind(bus, robot, contract, offset) for kind in (SenseNode, ActNode))  # type: ignore[arg-type]
    sense.step(0.0)
    state = bus.latest(topics.LOW_STATE)
    assert state is not None
    wanted = robot.q if offset is None else robot.q - 0.03
    np.testing.assert_array_equal(state.q, wanted)
    zeros = np.zeros(NUM_JOINTS)
    bus.publish(topics.LOW_CMD, LowCommand(0.0, state.q, zeros, zeros, zeros, zeros), 0.0)
    act.step(0.0)
    assert robot.told is not None
    np.testing.assert_allclose(robot.told.q, robot.q, atol=1e-15)


def test_a_stack_file_names_the_calibration(tmp_path: Path) -> None:
    file = tmp_path / "calibration.json"
    Calibration(joint_offset=np.zeros(NUM_JOINTS), views=7).save(file)
    stack = parse_stack(f"calibration: {{file: {file}}}", "x.yaml")
    assert stack.part("calibration").load().views == 7
    assert Stack().part("calibration").load().views == 0
    assert stack.with_part("calibration", file=None).part("calibration").load().views == 0
    assert stack.digest() != Stack().digest()
