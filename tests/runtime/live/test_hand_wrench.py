"""What a hand feels, as others read it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.skills.test_force_guard import torques

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.postures import POSTURES
from golem.interfaces import public
from golem.middleware.bus import Bus
from golem.runtime.live.stack_streams import MEAN, encoders
from golem.types import NUM_JOINTS, SIDES, UPPER, Imu, LowState, Side


@pytest.mark.parametrize("side", SIDES)
def test_a_push_at_a_hand_is_told_in_its_own_frame_as_what_the_world_does(side: Side) -> None:
    encode = encoders(Bus(), lambda: 0)[public.wrench(side)]
    q, tau, pulls = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS), np.array([3.0, -2.0, 12.0])
    q[UPPER] = POSTURES["ready"]
    imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.zeros(3))
    for force in (0.0 * pulls, *[pulls] * MEAN):
        tau[UPPER] = torques(side, force)
        message = encode(LowState(2.5, q.copy(), np.zeros(NUM_JOINTS), tau.copy(), imu))
    arm = UpperKinematics()
    arm.update(q[UPPER])
    felt = np.array([message.wrench.force.x, message.wrench.force.y, message.wrench.force.z])
    np.testing.assert_allclose(arm.placement(side).rotation @ felt, -pulls, rtol=0.01)
    assert (message.header.frame_id, message.header.stamp.sec) == (f"{side}_gripper", 2)
    assert abs(message.wrench.torque.x) < 0.1
