"""The black box of a stop opens at the moment of the fault."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from tests.dashboard import test_live

from golem.dashboard.stop_view import StopView, nearest, read_stop
from golem.errors import ConfigError
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import public
from golem.interfaces.payloads import GateState, GateStatus, Reason
from golem.middleware.bags.base import BagMessage
from golem.middleware.bags.recorder import topic
from golem.middleware.bags.writer import BagWriter
from golem.middleware.wire.convert import encode_low_command, encode_low_state
from golem.robots.model.table import JOINT_INDEX
from golem.runtime.live.black_box import BlackBox
from golem.types import Imu, LowCommand, LowState

meshes_are_made_once = test_live.meshes_are_made_once
KNEE = JOINT_INDEX["left_knee_joint"]
STILL = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))


def state(t: float) -> LowState:
    """Return a robot whose knee bends by 1 rad/s until it is kicked at 3 s."""
    q, dq = np.zeros(27), np.zeros(27)
    q[KNEE], dq[KNEE] = 0.1 * t, 1.0 if t < 3.0 else 12.0
    return LowState(t, q, dq, np.zeros(27), STILL)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    box = BlackBox(tmp_path, lambda said: None, run=lambda write: write())
    zeros = np.zeros(27)
    before = GateStatus(0.0, GateState.ACTIVE)
    for k in range(300):
        t = 0.02 * k
        box.add("/lowcmd", encode_low_command(LowCommand(t, zeros, zeros, zeros, zeros, zeros + 1.0), 0), t)
        box.add("/lowstate", b"\0\1\0\0damaged" if k == 7 else encode_low_state(state(t)), t)
        stopped = GateStatus(t, GateState.STOP1, Reason.VELOCITY, "left_knee_joint at 12.00 rad/s")
        status = stopped if t >= 3.0 else GateStatus(t, GateState.ACTIVE)
        box.judge(before, status)
        before = status
    box.flush()
    return box.written[0]


def test_a_black_box_is_read_with_the_stop_as_its_zero(folder: Path) -> None:
    stop = read_stop(folder)
    assert stop.status.reason is Reason.VELOCITY
    now = stop.at(0.0)
    assert stop.times[now] == pytest.approx(0.0, abs=1e-6) and stop.states[now].dq[KNEE] == 12.0
    assert stop.states[stop.at(-0.01)].dq[KNEE] == 1.0 and stop.at(-99.0) == 0
    assert stop.commands[now] is not None


def test_the_joint_that_is_nearest_to_its_limit_comes_first(folder: Path) -> None:
    stop = read_stop(folder)
    first = nearest(stop.states[stop.at(0.0)], None, SafetyLimits.from_profile()).splitlines()[2]
    assert first.startswith("| left_knee |") and "speed" in first and "12.0" in first


def test_what_is_no_black_box_is_said(tmp_path: Path) -> None:
    row = public.topic("/lowstate")
    bag = BagWriter(tmp_path / "calm")
    bag.write(BagMessage(topic(row.name, row.type, row.qos), 1, 1, encode_low_state(state(0.0))))
    bag.close()
    with pytest.raises(ConfigError, match="no black box of a stop"):
        read_stop(tmp_path / "calm")


def test_it_opens_at_the_moment_of_the_fault_and_the_slider_moves_the_robot(folder: Path) -> None:
    with closing(StopView(read_stop(folder), 0)) as view:
        assert view._time.value == 0.0
        view.update()
        assert "left_knee" in view._table.content
        knee = view._robot.scene.model.joint("left_knee_joint").qposadr[0]
        assert view._robot.data.qpos[knee] == pytest.approx(0.3)
        view._time.value = -2.0
        view.update()
        assert view._robot.data.qpos[knee] == pytest.approx(0.1)
