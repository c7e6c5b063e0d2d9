from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.postures import mirror
from golem.robots.model.pinocchio_model import Kinematics
from golem.types import NUM_JOINTS, SIDES, UPPER, Side


@pytest.fixture(scope="module")
def kinematics() -> UpperKinematics:
    return UpperKinematics()


def test_the_hands_do_not_depend_on_the_legs(kinematics: UpperKinematics) -> None:
    rng = np.random.default_rng(0)
    whole = Kinematics()
    for _ in range(20):
        q = rng.uniform(-0.4, 0.4, NUM_JOINTS)
        whole.update(q)
        for side in SIDES:
            np.testing.assert_allclose(kinematics.pose(side, q[UPPER]), whole.pose(f"{side}_gripper"), atol=1e-12)


@pytest.mark.parametrize("side", SIDES)
def test_jacobian_is_the_derivative_of_the_pose(kinematics: UpperKinematics, side: Side) -> None:
    rng = np.random.default_rng(1)
    h = 1e-6
    for _ in range(10):
        q = rng.uniform(kinematics.lower, kinematics.upper)
        kinematics.update(q)
        jacobian = kinematics.jacobian(side).copy()
        here = pin.SE3(kinematics.pose(side, q))
        for k in range(15):
            step = np.zeros(15)
            step[k] = h
            moved = pin.SE3(kinematics.pose(side, q + step))
            np.testing.assert_allclose(pin.log6(here.actInv(moved)).vector / h, jacobian[:, k], atol=1e-5)


def test_mirrored_postures_put_the_hands_at_mirrored_places(kinematics: UpperKinematics) -> None:
    rng = np.random.default_rng(2)
    flip = np.diag([1.0, -1.0, 1.0])
    q = rng.uniform(-0.5, 0.5, 15)
    left = kinematics.pose("left", q)
    right = kinematics.pose("right", mirror(q))
    np.testing.assert_allclose(right[:3, 3], flip @ left[:3, 3], atol=1e-4)
    np.testing.assert_allclose(right[:3, :3], flip @ left[:3, :3] @ flip, atol=1e-6)
    np.testing.assert_array_equal(mirror(mirror(q)), q)
