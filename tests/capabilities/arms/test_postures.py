from __future__ import annotations

import numpy as np
import pytest
from tests.capabilities.arms.solved_posture import solve_posture

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import TargetError
from golem.capabilities.arms.postures import POSTURES, downward, posture
from golem.errors import ConfigError
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.sensors.cameras import CAMERAS
from golem.types import NUM_JOINTS, SIDES, UPPER, Side

PLACES = {"home": (0.36, 0.44, 0.25), "ready": (0.43, 0.22, 0.20)}


@pytest.mark.parametrize("name", PLACES)
@pytest.mark.parametrize("side", SIDES)
def test_the_hands_point_down_where_the_docs_say(name: str, side: Side) -> None:
    x, y, z = PLACES[name]
    sign = 1.0 if side == "left" else -1.0
    kinematics = UpperKinematics()
    q = posture(name)
    np.testing.assert_allclose(kinematics.pose(side, q), downward(x, sign * y, z, sign * np.pi / 2), atol=1e-3)
    assert kinematics.margin(side, q) > 0.15
    assert kinematics.manipulability(side, q) > 0.11


def test_one_armed_postures_are_made_of_both() -> None:
    for name, left, right in (("ready_left", "ready", "home"), ("ready_right", "home", "ready")):
        np.testing.assert_array_equal(posture(name)[1:8], posture(left)[1:8])
        np.testing.assert_array_equal(posture(name)[8:], posture(right)[8:])


def test_at_home_the_hands_are_out_of_the_head_cameras_view() -> None:
    kinematics = Kinematics()
    q = np.zeros(NUM_JOINTS)
    q[UPPER] = posture("home")
    kinematics.update(q)
    to_optical = np.linalg.inv(kinematics.pose("head_camera_optical"))
    info = CAMERAS["head"]
    for side in SIDES:
        hand, elbow = kinematics.pose(f"{side}_gripper"), kinematics.pose(f"{side}_elbow_link")
        wrist = kinematics.pose(f"{side}_wrist_yaw_link")
        # A hand's half width is 0.09 m with the fingers wide open, the arm's radius is below that.
        for point in (hand, elbow, wrist, 0.5 * (hand + wrist)):
            x, _, z = (to_optical @ point[:, 3])[:3]
            side_plane = (abs(x) * info.fx - z * info.width / 2) / np.hypot(info.fx, info.width / 2)
            assert side_plane > 0.09


def test_solving_again_gives_a_posture_as_good() -> None:
    goal = downward(0.43, -0.22, 0.20, -np.pi / 2)
    rng = np.random.default_rng(0)
    starts = posture("ready") + rng.normal(scale=0.2, size=(6, 15))
    q = solve_posture(None, goal, starts, torso_range=1e-9)
    kinematics = UpperKinematics()
    np.testing.assert_allclose(kinematics.pose("right", q), goal, atol=1e-3)
    assert kinematics.margin("right", q) > 0.2
    np.testing.assert_allclose(q[8:], posture("ready")[8:], atol=0.25)


def test_a_place_out_of_reach_is_named() -> None:
    starts = np.tile(posture("ready"), (2, 1))
    with pytest.raises(TargetError, match="No posture reaches"):
        solve_posture(None, downward(2.0, 0.0, 0.2, 0.0), starts)


def test_unknown_posture_names_the_valid_ones() -> None:
    with pytest.raises(ConfigError, match="ready_left"):
        posture("redy")


def test_callers_cannot_change_a_posture() -> None:
    posture("home")[:] = 0.0
    assert np.abs(POSTURES["home"]).max() > 1.0
