"""Mount and encoder zeros are found again from views that a camera would have had, with the noise it says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from golem.capabilities.calibration.kinematic_fit import ARM, PIXEL, VIEWS, TagView, ViewProblem, fit, solve
from golem.capabilities.calibration.view_postures import view_postures
from golem.errors import ConfigError
from golem.robots.model.magpie_model import cuff_tags, hand_name, tag_corners
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.table import T_TORSO_HEAD_OPTICAL
from golem.robots.sensors.cameras import HEAD, project
from golem.types import NUM_JOINTS, SIDES, UPPER, Array, Side

NOTHING: Callable[[Array], Array] = lambda q: np.zeros((0, 4))  # noqa: E731


def seen(side: Side, q: Array, mount: Array, offset: Array, rng: np.random.Generator) -> TagView:
    """Return what a camera at `mount` sees of a hand whose joints are at `q` and report `offset` more."""
    kinematics = Kinematics()
    kinematics.update(q)
    T = np.linalg.inv(T_TORSO_HEAD_OPTICAL @ mount) @ np.linalg.solve(
        kinematics.pose("torso_link"), kinematics.pose(hand_name(side))
    )
    corners: dict[int, Array] = {}
    for number, tag in cuff_tags(side).items():
        T_tag = T @ tag
        if T_tag[:3, 2] @ T_tag[:3, 3] > 0.4 * np.linalg.norm(T_tag[:3, 3]):
            points = (T_tag @ np.column_stack([tag_corners(), np.ones(4)]).T).T[:, :3]
            corners[number] = project(HEAD, points) + PIXEL * rng.standard_normal((4, 2))
    return TagView(side, q + offset, corners)


def views(count: int, mount: Array, offset: Array, seed: int) -> list[TagView]:
    """Return views of both hands."""
    rng = np.random.default_rng(seed)
    out: list[TagView] = []
    for side in SIDES:
        for posture in view_postures(side, count, lambda q: True, NOTHING):
            q = np.zeros(NUM_JOINTS)
            q[UPPER] = posture
            out.append(seen(side, q, mount, offset, rng))
    return out


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_mount_and_zeros_are_found_within_what_the_covariance_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mount = np.eye(4)
    mount[:3, :3] = Rotation.from_rotvec(rng.choice([-0.04, 0.04], 3)).as_matrix()
    mount[:3, 3] = rng.choice([-0.02, 0.02], 3)
    offset = np.zeros(NUM_JOINTS)
    for arm in ARM.values():
        offset[arm] = 0.03 * rng.standard_normal(7)
    found = fit(views(16, mount, offset, seed), HEAD)
    ahead = np.array([0.0, 0.0, 1.0, 1.0])
    apart = np.linalg.norm((found.cameras["head"] - mount) @ ahead)
    assert np.linalg.norm((np.eye(4) - mount) @ ahead) > 0.02 and apart < 0.010
    error = (found.joint_offset - offset)[13:] / found.joint_sigma[13:]
    assert np.abs(error).max() < 4.0 and np.sqrt(np.mean(error**2)) < 1.6
    assert found.residual == pytest.approx(PIXEL, rel=0.25)


@pytest.mark.slow
def test_a_tag_that_is_half_hidden_is_left_out() -> None:
    seen_well = views(10, np.eye(4), np.zeros(NUM_JOINTS), 1)
    spoilt = [
        replace(v, corners={n: c + (12.0 if i == 0 else 0.0) for n, c in v.corners.items()})
        for i, v in enumerate(seen_well)
    ]
    found = fit(spoilt, HEAD)
    assert found.views == len(seen_well) - 1 and found.residual < 1.5 * PIXEL


@pytest.mark.slow
def test_one_hand_does_not_do() -> None:
    of_left = [v for v in views(8, np.eye(4), np.zeros(NUM_JOINTS), 0) if v.side == "left"]
    with pytest.raises(ConfigError, match="right hand's tags were seen in 0 postures"):
        fit(of_left, HEAD)


class Shifted(ViewProblem):
    """Every tag is at one place in the image, the unknown."""

    scale = np.full(2, 100.0)

    def pixels(self, x: Array) -> Array:
        return np.concatenate([(x - c).ravel() for view in self.views for c in view.corners.values()])


def test_views_of_a_hand_that_contradict_each_other_are_no_calibration() -> None:
    agree = [TagView("left", np.zeros(NUM_JOINTS), {0: np.full((4, 2), 7.0)})] * VIEWS
    odd = [TagView("right", np.zeros(NUM_JOINTS), {0: np.full((4, 2), 50.0 * (i + 1))}) for i in range(VIEWS)]
    assert solve(Shifted(agree, HEAD))[0] == pytest.approx([7.0, 7.0], abs=0.01)
    for given in ([*agree, *odd], odd):
        with pytest.raises(ConfigError, match="Only . views of the right hand's tags agree"):
            solve(Shifted(given, HEAD))


def test_postures_are_seen_free_and_apart() -> None:
    asked: list[Array] = []

    def free(q: Array) -> bool:
        asked.append(q)
        return len(asked) % 2 == 0

    found = view_postures("left", 8, free, NOTHING)
    assert len(found) == 8
    assert min(np.abs(a - b).max() for i, a in enumerate(found) for b in found[:i]) > 0.3
    # What stands before the camera hides every tag.
    assert view_postures("left", 8, free, lambda q: np.array([[0.206, 0.018, 0.572, 0.3]])) == []
