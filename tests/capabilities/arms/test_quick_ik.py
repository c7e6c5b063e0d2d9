"""The quick inverse kinematics finds what an arm reaches, by the logarithm that Pinocchio has."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.ik_kernel import logarithm
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.arms.quick_ik import QuickIK


def test_it_finds_what_the_arm_reaches_and_nothing_else() -> None:
    ik, kinematics = QuickIK(), UpperKinematics()
    rng = np.random.default_rng(0)
    found = 0
    for _ in range(20):
        q = POSTURES["forward"].copy()
        q[8:] += 0.3 * rng.standard_normal(7)
        q = np.clip(q, kinematics.lower + 0.01, kinematics.upper - 0.01)
        T = kinematics.pose("right", q)
        solved = ik.solve("right", T, POSTURES["forward"][None])
        if solved is not None:
            found += 1
            np.testing.assert_allclose(kinematics.pose("right", solved)[:3, 3], T[:3, 3], atol=1.1e-3)
            assert ((solved >= kinematics.lower) & (solved <= kinematics.upper)).all()
            np.testing.assert_array_equal(solved[:8], POSTURES["forward"][:8])
    assert found >= 18
    far = np.eye(4)
    far[:3, 3] = 2.0, 0.0, 0.0
    assert ik.solve("right", far, POSTURES["forward"][None]) is None


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 0.1, 1.5, 3.0, np.pi - 1e-6])
def test_the_logarithm_is_that_of_pinocchio(angle: float) -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        axis = rng.standard_normal(3)
        R, p, out = pin.exp3(angle * axis / np.linalg.norm(axis)), rng.standard_normal(3), np.empty(6)
        logarithm(R, p, out)
        np.testing.assert_allclose(out, pin.log6(pin.SE3(R, p)).vector, atol=1e-5)
