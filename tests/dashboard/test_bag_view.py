"""A black box opens at the moment of the fault, and any bag of a robot from its start."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.dashboard import test_live

from golem.dashboard.bag_view import BagView, nearest, read_recording
from golem.errors import ConfigError
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import images, public
from golem.interfaces import ros_convert as convert
from golem.interfaces.payloads import GateState, GateStatus, Reason
from golem.middleware.bags.base import BagMessage, BagTopic
from golem.middleware.bags.recorder import topic
from golem.middleware.bags.writer import BagWriter
from golem.middleware.ros import codec
from golem.middleware.ros.msgs.geometry_msgs import PoseWithCovariance
from golem.middleware.ros.msgs.nav_msgs import Odometry
from golem.middleware.wire.convert import encode_low_command, encode_low_state
from golem.robots.model.table import JOINT_INDEX
from golem.runtime.live.black_box import STATUS, BlackBox
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
    stop = read_recording(folder)
    assert stop.stop is not None and stop.stop.reason is Reason.VELOCITY
    now = stop.at(0.0)
    assert stop.times[now] == pytest.approx(0.0, abs=1e-6) and stop.states[now].dq[KNEE] == 12.0
    assert stop.states[stop.at(-0.01)].dq[KNEE] == 1.0 and stop.at(-99.0) == 0
    assert stop.commands[now] is not None


def test_the_joint_that_is_nearest_to_its_limit_comes_first(folder: Path) -> None:
    stop = read_recording(folder)
    first = nearest(stop.states[stop.at(0.0)], None, SafetyLimits.from_profile()).splitlines()[2]
    assert first.startswith("| left_knee |") and "speed" in first and "12.0" in first


def test_a_bag_without_a_robot_is_said(tmp_path: Path) -> None:
    row = public.topic("/odom")
    bag = BagWriter(tmp_path / "bag")
    bag.write(BagMessage(topic(row.name, row.type, row.qos), 1, 1, odom(0.0)))
    bag.close()
    with pytest.raises(ConfigError, match="holds no /lowstate"):
        read_recording(tmp_path / "bag")


def odom(x: float) -> bytes:
    T = np.eye(4)
    T[0, 3] = x
    return bytes(codec.serialize(Odometry(pose=PoseWithCovariance(pose=convert.pose(T)))))


def test_frames_of_any_topic_that_nobody_can_read_are_left_out(tmp_path: Path) -> None:
    bag, image = BagWriter(tmp_path / "bag"), public.image("head", public.COLOR)
    payloads = dict.fromkeys(("/odom", "/safety/status", image), b"\0\1\0\0damaged") | {
        "/lowstate": encode_low_state(state(0.0))
    }
    for name, payload in payloads.items():
        row = public.topic(name)
        bag.write(BagMessage(topic(row.name, row.type, row.qos), 10, 10, payload))
    bag.close()
    recording = read_recording(tmp_path / "bag")
    assert len(recording.times) == 1 and recording.bases == (None,) and recording.stop is None
    assert recording.picture(image, 0.0) is None


def test_any_bag_is_played_from_its_start(tmp_path: Path) -> None:
    """States are thinned, the robot stands where /odom says, and a picture belongs to its moment."""
    rows, bag = dict[str, BagTopic](), BagWriter(tmp_path / "bag")

    def add(name: str, t: float, payload: bytes) -> None:
        if name not in rows:
            row = public.topic(name)
            rows[name] = topic(row.name, row.type, row.qos)
        bag.write(BagMessage(rows[name], round(t * 1e9), round(t * 1e9), payload))

    image = public.image("head", public.COLOR)
    for k in range(200):
        t = 100.0 + 0.01 * k
        add("/odom", t, odom(0.01 * k))
        add("/lowstate", t, encode_low_state(state(t - 100.0)))
        if k % 50 == 0:
            rgb = np.full((4, 6, 3), k, np.uint8)
            add(image, t, bytes(codec.serialize(images.color_image(t, rgb, "camera_color_optical_frame"))))
    bag.close()
    recording = read_recording(tmp_path / "bag")
    assert recording.stop is None and len(recording.times) == 100
    assert recording.times[0] == 0.0 and recording.times[-1] == pytest.approx(1.98)
    seen = recording.picture(image, 1.2)
    assert seen is not None and (seen == 100).all()
    assert recording.picture(image, 9.0) is None
    with closing(BagView(recording, 0)) as view:
        view._time.value = 1.0
        view.update()
        assert view._robot.data.qpos[0] == pytest.approx(1.0)
        assert list(view._pictures) == [image]
        view._joint.value, view._quantity.value = "left_knee", "speed [rad/s]"
        view.update()
        assert (view._plot.data[1] == 1.0).all() and view._plot.data[0][0] == pytest.approx(-1.0)


@pytest.mark.parametrize(("stop", "shown"), [(None, 3.0), (1, 1.0), (2, 2.0), (3, 3.0)])
def test_of_a_robot_that_was_restarted_one_start_is_shown(tmp_path: Path, stop: int | None, shown: float) -> None:
    """Its clock began again: states of the first start were shown as those of a stop in the second."""
    bag = BagWriter(tmp_path / "bag")
    rows = {name: topic(name, public.topic(name).type) for name in ("/lowstate", STATUS)}
    for start, length in ((1, 250), (2, 150), (3, 200)):
        for k in range(length):
            at = 20_000_000 * k
            one = replace(state(at * 1e-9), q=np.full(27, float(start)))
            bag.write(BagMessage(rows["/lowstate"], at, at, encode_low_state(one)))
            if start == stop and k == 100:
                status = convert.gate_status(GateStatus(at * 1e-9, GateState.STOP1, Reason.REQUESTED))
                bag.write(BagMessage(rows[STATUS], at, at, codec.serialize(status)))
    bag.close()
    recording = read_recording(tmp_path / "bag")
    assert {one.q[0] for one in recording.states} == {shown} and (np.diff(recording.times) > 0.0).all()
    assert recording.times[0] == pytest.approx(0.0 if stop is None else -2.0)


def test_it_opens_at_the_moment_of_the_fault_and_the_slider_moves_the_robot(folder: Path) -> None:
    with closing(BagView(read_recording(folder), 0)) as view:
        assert view._time.value == 0.0
        view.update()
        assert "left_knee" in view._table.content
        knee = view._robot.scene.model.joint("left_knee_joint").qposadr[0]
        assert view._robot.data.qpos[knee] == pytest.approx(0.3)
        view._time.value = -2.0
        view.update()
        assert view._robot.data.qpos[knee] == pytest.approx(0.1)
