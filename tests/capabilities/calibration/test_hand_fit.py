"""The mount of a palm camera is found again from views of the other hand, with the noise and the zeros it says."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from golem.capabilities.calibration.hand_fit import OTHER, SPARE, fit_hand, hand_view_postures
from golem.capabilities.calibration.kinematic_fit import ARM, PIXEL, TagView, pose
from golem.errors import ConfigError
from golem.hardware.safety.base import SafetyLimits
from golem.robots.model.magpie_model import T_HAND_CAMERA, cuff_tags, hand_name, tag_corners
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.sensors.cameras import CAMERAS, project
from golem.types import NUM_JOINTS, SIDES, UPPER, Array, Side

ZERO = 0.002


@cache
def postures(camera: Side) -> list[Array]:
    return hand_view_postures(camera, 16, lambda q: True, lambda q: np.zeros((0, 4)), ZERO)


def seen(camera: Side, q: Array, mount: Array, offset: Array, rng: np.random.Generator) -> TagView:
    """Return what a palm camera at `mount` sees of the other hand, the joints being at `q` and reporting more."""
    kinematics, info = Kinematics(), CAMERAS[f"{camera}_hand"]
    kinematics.update(q)
    T_eye = kinematics.pose(hand_name(camera)) @ T_HAND_CAMERA @ mount
    T = np.linalg.solve(T_eye, kinematics.pose(hand_name(OTHER[camera])))
    corners: dict[int, Array] = {}
    for number, tag in cuff_tags(OTHER[camera]).items():
        T_tag = T @ tag
        if T_tag[2, 3] > 0.0 and T_tag[:3, 2] @ T_tag[:3, 3] > 0.4 * np.linalg.norm(T_tag[:3, 3]):
            points = (T_tag @ np.column_stack([tag_corners(), np.ones(4)]).T).T[:, :3]
            corners[number] = project(info, points) + PIXEL * rng.standard_normal((4, 2))
    return TagView(OTHER[camera], q + offset, corners)


@pytest.mark.parametrize("camera", SIDES)
def test_the_mount_is_found_within_what_the_covariance_says(camera: Side) -> None:
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.choice([-0.01, 0.01], 3), rng.choice([-0.002, 0.002], 3)])
    views: list[TagView] = []
    offset = np.zeros(NUM_JOINTS)
    for arm in ARM.values():
        offset[arm] = ZERO * rng.standard_normal(7)
    for upper in postures(camera):
        q = np.zeros(NUM_JOINTS)
        q[UPPER] = upper
        views.append(seen(camera, q, pose(x), offset, rng))
    found = fit_hand(views, camera, CAMERAS[f"{camera}_hand"], ZERO)
    name, ahead = f"{camera}_hand", np.array([0.0, 0.0, 0.1, 1.0])
    apart = (found.cameras[name] - pose(x)) @ ahead
    assert np.linalg.norm((np.eye(4) - pose(x)) @ ahead) > 0.002 > 2.0 * np.linalg.norm(apart)
    change = np.linalg.solve(pose(x), found.cameras[name])
    error = np.array([change[2, 1], change[0, 2], change[1, 0], *change[:3, 3]])
    assert error @ np.linalg.solve(found.covariances[name], error) < 25.0
    assert found.residual == pytest.approx(PIXEL, rel=0.25) and not found.joint_offset.any()


def test_postures_show_the_other_hand_within_the_range() -> None:
    limits, found = SafetyLimits.from_profile(), postures("left")
    assert len(found) == 16
    for q in found:
        assert np.all(q >= limits.lower[UPPER] + SPARE - 1e-9) and np.all(q <= limits.upper[UPPER] - SPARE + 1e-9)
    blocked = hand_view_postures("left", 4, lambda q: False, lambda q: np.zeros((0, 4)), ZERO)
    assert blocked == []


def test_too_few_views_are_said() -> None:
    with pytest.raises(ConfigError, match="left palm camera saw the right hand's tags in 0 postures; 6 are"):
        fit_hand([], "left", CAMERAS["left_hand"], ZERO)
