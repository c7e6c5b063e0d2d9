"""The scans stay away while a robot walks by them: twin, gate, stack and client are members of one domain."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from tests.runtime.live.conftest import BLIND, Live
from tests.runtime.live.test_skill_action_server import Client

from golem.interfaces import ros_convert as convert
from golem.interfaces.lidar import LidarImu, LidarScan
from golem.interfaces.payloads import GateState
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.msgs.geometry_msgs import PoseStamped
from golem.middleware.ros.msgs.golem_interfaces import Walk_Goal
from golem.stack import load_stack
from golem.types import PlanarPose


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_client_is_told_and_the_robot_stands(tmp_path: Path) -> None:
    (tmp_path / "blind.py").write_text(BLIND)
    live = Live(load_stack("hall", profile="bench").with_choice("localizer", f"{tmp_path / 'blind.py'}:Blind"))
    live.start_twin()
    live.start_gate()
    live.start_up()
    live.activate()
    client = Client(live, live.member("client")[1])
    live.run(4.0)
    goal = Walk_Goal(PoseStamped(convert.header(0.0, "base_link"), convert.pose(PlanarPose(5.0, 0.0, 0.0).matrix())))
    walk = client.send("/skill/navigate", goal)
    client.until(lambda: bool(np.linalg.norm(live.robot.data.qpos[:2]) > 0.5), 20.0)
    lidar = live.robot.lidar

    def without_scans(t: float) -> tuple[Sequence[LidarImu], LidarScan | None]:
        return lidar(t)[0], None

    live.robot.lidar = without_scans
    status, result = client.outcome(walk, 10.0)
    assert (status, result.success, result.slot) == (GoalStatus.ABORTED, False, "odometry")
    assert "No scan has fitted the map" in result.reason
    live.run(2.0)
    before = live.robot.data.qpos[:2].copy()
    live.run(1.0)
    assert np.linalg.norm(live.robot.data.qpos[:2] - before) < 0.03
    assert live.state is GateState.ACTIVE
    live.close()
