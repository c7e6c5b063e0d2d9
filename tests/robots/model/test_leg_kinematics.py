from __future__ import annotations

import numpy as np

from golem.robots.model.leg_kinematics import leg_poses, sole_centers
from golem.robots.model.pinocchio_model import Kinematics
from golem.types import NUM_JOINTS, SIDES


def test_agrees_with_pinocchio_for_one_and_for_many() -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.8, 0.8, (5, NUM_JOINTS))
    p, R = leg_poses(q[:, :12])
    assert p.shape == (5, 2, 3) and R.shape == (5, 2, 3, 3)
    kinematics = Kinematics()
    for row in range(5):
        kinematics.update(q[row])
        one_p, one_R = leg_poses(q[row, :12])
        np.testing.assert_allclose(one_p, p[row], atol=1e-12)
        for side, name in enumerate(SIDES):
            T = kinematics.pose(f"{name}_ankle_roll_link")
            np.testing.assert_allclose(one_p[side], T[:3, 3], atol=1e-9)
            np.testing.assert_allclose(one_R[side], T[:3, :3], atol=1e-9)


def test_soles_of_the_straight_robot_stand_side_by_side() -> None:
    soles = sole_centers(*leg_poses(np.zeros(12)))
    np.testing.assert_allclose(soles[0, 1], -soles[1, 1], atol=1e-12)
    np.testing.assert_allclose(soles[0, [0, 2]], soles[1, [0, 2]], atol=1e-12)
    assert soles[0, 1] > 0.1 and soles[0, 2] < -1.0
