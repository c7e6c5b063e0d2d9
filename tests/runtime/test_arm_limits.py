"""Arms that leave their limits, or jump, are named; those that keep them are not."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.arms.postures import POSTURES
from golem.errors import ModuleFault
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.runtime.contract_check import ContractCheck
from golem.runtime.nodes import BEGINNING, ROUNDING, ArmLimits
from golem.types import NUM_JOINTS, UPPER, Array

LIMITS = load_limits()
PERIOD = 0.01


def measured() -> Array:
    q = np.zeros(NUM_JOINTS)
    q[UPPER] = POSTURES["home"]
    return q


@pytest.fixture
def limits() -> ArmLimits:
    new = ArmLimits(ContractCheck("upper_body", "mine.py:Arms"), PERIOD)
    new.reset(measured())
    return new


def test_a_motion_at_the_speed_limit_passes(limits: ArmLimits) -> None:
    q = measured()[UPPER]
    for _ in range(20):
        q = np.minimum(q + LIMITS.velocity[UPPER] * PERIOD, LIMITS.upper[UPPER])
        limits.check(q)


def test_a_jump_is_named_with_its_joint(limits: ArmLimits) -> None:
    q = measured()[UPPER]
    limits.check(q)
    q = q.copy()
    q[4] -= 1.0
    with pytest.raises(ModuleFault, match="left_elbow_joint jumps by 1 rad in a tick of 0.01 s.* 0.2 rad at most"):
        limits.check(q)


def test_targets_that_do_not_start_from_the_measured_joints_are_a_jump(limits: ArmLimits) -> None:
    with pytest.raises(ModuleFault, match="jumps by"):
        limits.check(np.zeros(15, dtype=int))


def test_a_controller_with_narrower_limits_may_start_inside_them(limits: ArmLimits) -> None:
    q = LIMITS.upper.copy() + 0.05
    limits.reset(q)
    limits.check(LIMITS.upper[UPPER] - 0.9 * BEGINNING)


@pytest.mark.parametrize("beyond", [0.01, -0.01])
def test_a_position_limit_is_kept(limits: ArmLimits, beyond: float) -> None:
    edge = (LIMITS.upper if beyond > 0 else LIMITS.lower).copy()
    limits.reset(edge)
    limits.check(edge[UPPER])
    q = edge[UPPER].copy()
    q[9] += beyond
    with pytest.raises(ModuleFault, match="right_shoulder_roll_joint to .* outside its limits"):
        limits.check(q)


def test_after_a_reset_earlier_targets_do_not_count(limits: ArmLimits) -> None:
    limits.check(measured()[UPPER])
    limits.reset(np.zeros(NUM_JOINTS))
    limits.check(np.zeros(15))


def test_the_joint_that_is_named_is_the_one_that_is_furthest_off() -> None:
    rng = np.random.default_rng(6)
    lower, upper = LIMITS.lower[UPPER], LIMITS.upper[UPPER]
    for _ in range(50):
        q = np.clip(rng.normal(0.0, 2.0, len(lower)), lower - 1.0, upper + 1.0)
        outside = np.maximum(lower - q, q - upper)
        assert outside.max() > ROUNDING
        limits = ArmLimits(ContractCheck("upper_body", "mine.py:Arms"), PERIOD)
        with pytest.raises(ModuleFault) as caught:
            limits.check(q)
        assert JOINT_NAMES[UPPER][int(outside.argmax())] in str(caught.value)
