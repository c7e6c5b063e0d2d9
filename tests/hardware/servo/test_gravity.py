from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from golem.hardware.servo.gravity import Gravity
from golem.robots.model.pinocchio_model import build
from golem.robots.model.table import load_limits


@pytest.mark.parametrize("hands", [True, False])
def test_it_equals_the_free_flyer_at_any_inclination(hands: bool) -> None:
    model = build(hands=hands, free_base=True)
    data, gravity, limits = model.createData(), Gravity(hands=hands), load_limits()
    rng = np.random.default_rng(1)
    for _ in range(50):
        q = rng.uniform(limits.lower, limits.upper)
        base = pin.Quaternion(rng.normal(size=4)).normalized()
        full = np.concatenate([rng.normal(size=3), base.coeffs(), q])
        expected = pin.computeGeneralizedGravity(model, data, full)[6:]
        pin.framesForwardKinematics(model, data, full)
        imu = pin.Quaternion(data.oMf[model.getFrameId("imu_link")].rotation).coeffs()
        torque = gravity.torque(q, np.roll(imu, 1))
        np.testing.assert_allclose(torque, expected, atol=1e-9)


def test_the_length_of_the_quaternion_does_not_matter() -> None:
    gravity, q = Gravity(), np.full(27, 0.2)
    quat = np.array([0.9, 0.1, -0.3, 0.2])
    once = gravity.torque(q, quat).copy()
    np.testing.assert_allclose(gravity.torque(q, 3.0 * quat), once, atol=1e-12)
