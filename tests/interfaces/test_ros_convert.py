from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from golem.interfaces import ros_convert as convert
from golem.interfaces.payloads import Detections, LegStatus
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.msgs.diagnostic_msgs import DiagnosticStatus
from golem.middleware.ros.msgs.geometry_msgs import Point, Pose, Quaternion
from golem.types import BaseEstimate, Detection, HandCommand, HandState, LocalizedObject, PlanarPose, Twist


def T(rpy: tuple[float, float, float], xyz: tuple[float, float, float]) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
    T[:3, 3] = xyz
    return T


@given(st.floats(-(2.0**31) + 1, 2.0**31 - 2))
def test_time_keeps_a_double(t: float) -> None:
    stamp = convert.time(t)
    assert 0 <= stamp.nanosec < 1_000_000_000
    assert convert.seconds(stamp) == pytest.approx(t, abs=1e-6)


def test_time_before_zero_counts_nanoseconds_up() -> None:
    # As builtin_interfaces/Time says: -1.7 s is sec -2, nanosec 3e8.
    assert (convert.time(-1.7).sec, convert.time(-1.7).nanosec) == (-2, 300_000_000)


def test_the_end_of_a_second_does_not_become_a_thousand_million_nanoseconds() -> None:
    stamp = convert.time(0.9999999999)
    assert (stamp.sec, stamp.nanosec) == (1, 0)


@pytest.mark.parametrize("t", [float("nan"), float("inf"), 2.0**31])
def test_what_is_no_time_is_refused(t: float) -> None:
    with pytest.raises(CodecError, match="no time"):
        convert.time(t)


def test_quaternions_change_their_order() -> None:
    assert convert.quaternion(np.array([1.0, 2.0, 3.0, 4.0])) == Quaternion(2.0, 3.0, 4.0, 1.0)


def test_a_turn_to_the_left_is_a_positive_z() -> None:
    made = convert.pose(T((0.0, 0.0, np.pi / 2), (1.0, 2.0, 3.0)))
    assert made.position == Point(1.0, 2.0, 3.0)
    assert (made.orientation.z, made.orientation.w) == pytest.approx((np.sqrt(0.5), np.sqrt(0.5)))


@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.tuples(*[st.floats(-1e3, 1e3)] * 3))
def test_poses_survive(rpy: tuple[float, float, float], xyz: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(convert.matrix(convert.pose(T(rpy, xyz))), T(rpy, xyz), atol=1e-9)


@pytest.mark.parametrize(
    "q", [(0.0, 0.0, 0.0, 0.0), (float("nan"), 0.0, 0.0, 1.0), (1e200, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, float("inf"))]
)
def test_what_is_no_pose_is_refused(q: tuple[float, float, float, float]) -> None:
    with pytest.raises(CodecError, match="no position"):
        convert.matrix(Pose(orientation=Quaternion(*q)))


def test_transforms_name_parent_and_child() -> None:
    poses = np.stack([T((0.0, 0.0, 0.1 * k), (float(k), 0.0, 0.0)) for k in range(3)])
    message = convert.transforms(1.5, [("odom", "a"), ("a", "b"), ("b", "c")], poses)
    assert [(t.header.frame_id, t.child_frame_id) for t in message.transforms] == [
        ("odom", "a"),
        ("a", "b"),
        ("b", "c"),
    ]
    assert [t.transform.translation.x for t in message.transforms] == [0.0, 1.0, 2.0]
    assert message.transforms[2].transform.rotation.z == pytest.approx(np.sin(0.1))
    assert message.transforms[2].header.stamp == convert.time(1.5)
    assert convert.transforms(0.0, [], np.zeros((0, 4, 4))).transforms == []


def test_joints_keep_their_order() -> None:
    message = convert.joint_state(2.0, ["a", "b"], np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.zeros(0))
    assert message.name == ["a", "b"]
    assert message.velocity.tolist() == [3.0, 4.0] and message.effort.size == 0


def test_velocity_commands_survive() -> None:
    assert convert.to_twist(convert.twist(Twist(0.3, -0.1, 0.5))) == Twist(0.3, -0.1, 0.5)


def test_odometry_gives_its_velocity_in_the_child_frame() -> None:
    estimate = BaseEstimate(1.0, T((0.0, 0.0, np.pi / 2), (5.0, 0.0, 1.0)), np.array([0.0, 2.0, 0.0]))
    message = convert.odometry(estimate, np.array([0.0, 0.0, 0.7]))
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
    linear = message.twist.twist.linear
    assert (linear.x, linear.y) == pytest.approx((2.0, 0.0), abs=1e-12)
    assert message.twist.twist.angular.z == 0.7
    for covariance in (message.pose.covariance, message.twist.covariance):
        assert len(covariance) == 36 and (np.diag(np.reshape(covariance, (6, 6))) > 0.0).all()


def test_diagnostics_say_what_is_wrong() -> None:
    status = convert.diagnostic(DiagnosticStatus.ERROR, "gate", "estop_stale", {"age [ms]": 71})
    message = convert.diagnostics(3.0, [status])
    assert message.status[0].values[0].key == "age [ms]" and message.status[0].values[0].value == "71"
    assert message.status[0].level == 2


def test_base_estimates_survive() -> None:
    estimate = BaseEstimate(
        12.5, T((0.1, -0.2, 2.0), (1.0, 2.0, 1.03)), np.array([0.1, 0.2, 0.3]), 1.02, np.array([0.9, 0.1]), True
    )
    back = convert.to_base_estimate(convert.base_estimate(estimate))
    np.testing.assert_allclose(back.T_odom_base, estimate.T_odom_base, atol=1e-12)
    assert back.velocity.tolist() == [0.1, 0.2, 0.3] and back.contact.tolist() == [0.9, 0.1]
    assert (back.t, back.height, back.stale) == (12.5, 1.02, True)


def test_hands_survive() -> None:
    state = HandState(1.0, 0.05, np.array([0.02, 0.03]), np.array([1.0, 2.0]))
    message = convert.hand_state(state, "left")
    back = convert.to_hand_state(message)
    assert message.header.frame_id == "left_gripper"
    assert (back.t, back.gap, back.fingers.tolist(), back.force.tolist()) == (1.0, 0.05, [0.02, 0.03], [1.0, 2.0])
    for change in ({"gap": np.nan}, {"fingers": np.array([0.0, np.inf])}, {"force": np.array([np.nan, 0.0])}):
        with pytest.raises(CodecError, match="reports a gap"):
            convert.to_hand_state(convert.hand_state(replace(state, **change), "left"))
    command = HandCommand(2.0, 0.01, 16.0)
    assert convert.to_hand_command(convert.hand_command(command, "right")) == command
    for change in ({"gap": np.nan}, {"force": np.inf}):
        with pytest.raises(CodecError, match="told a gap"):
            convert.to_hand_command(convert.hand_command(replace(command, **change), "right"))


def test_a_height_survives_and_none_is_nan() -> None:
    assert convert.to_cmd_height(convert.cmd_height(Twist(height=0.8))) == Twist(height=0.8)
    assert np.isnan(convert.cmd_height(Twist(0.3)).data)


def test_legs_say_why_they_stand() -> None:
    status = LegStatus(
        1.0,
        Twist(5.0),
        Twist(1.0),
        True,
        "too fast",
        True,
        True,
        PlanarPose(0.0, 0.0, 0.0),
        np.array([0.0, 0.5]),
        "almi",
    )
    message = convert.leg_status(status)
    assert (message.commanded.linear.x, message.applied.linear.x, message.fault) == (5.0, 1.0, "")
    assert message.phase.tolist() == [0.0, 0.5] and message.clamped and message.stepping


def test_sightings_say_what_was_found_and_where() -> None:
    detection = Detection("screw", 0.9, np.arange(4.0), np.array([1.5, 2.5]))
    cloud = np.arange(12.0).reshape(4, 3)
    seen = Detections(3.0, "head", (LocalizedObject(detection, 3.0, np.array([0.4, 0.0, 0.9]), cloud),))
    message = convert.sightings(seen)
    assert (message.header.stamp.sec, message.header.frame_id, message.camera) == (3, "odom", "head")
    (found,) = message.objects
    assert (found.label, found.score, found.position) == ("screw", 0.9, Point(0.4, 0.0, 0.9))
    assert found.box.tolist() == [0.0, 1.0, 2.0, 3.0] and found.center.tolist() == [1.5, 2.5]
    assert found.points.tolist() == list(range(12))
