"""A hand that pulls at what is tight, or stands on something, is told by the torques of its arm."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import ARM_COLUMNS
from golem.capabilities.arms.hand_force import HandForce
from golem.capabilities.arms.postures import POSTURES
from golem.interfaces import topics
from golem.skills.force_guard import REST, TICKS, ForceGuard
from golem.types import NUM_JOINTS, SIDES, UPPER, Array, Imu, LowState, Side

UP = np.array([0.0, 0.0, 1.0])


def torques(side: Side, force: Array) -> Array:
    """Return (15,) what the motors do at `ready` while the hand exerts `force` (3,) in base_link [N]."""
    arm, q = UpperKinematics(), POSTURES["ready"]
    tau = pin.computeGeneralizedGravity(arm.model, arm.data, q).copy()
    arm.update(q)
    local = np.concatenate([arm.placement(side).rotation.T @ force, np.zeros(3)])
    tau[ARM_COLUMNS[side]] += arm.jacobian(side)[:, ARM_COLUMNS[side]].T @ local
    return tau


@pytest.mark.parametrize("side", SIDES)
def test_the_force_of_a_hand_is_found_in_the_torques(side: Side) -> None:
    force = np.array([3.0, -2.0, 12.0])
    np.testing.assert_allclose(HandForce()(side, POSTURES["ready"], torques(side, force)), force, rtol=0.01)


@pytest.mark.parametrize("side", SIDES)
def test_errors_of_the_torques_are_not_taken_for_a_force_where_the_arm_resists_little(side: Side) -> None:
    # A moment of 1 N m that no finger can meet, as friction and masses leave it, looked like 4 N before.
    feel, tau = HandForce(), torques(side, np.zeros(3))
    rng = np.random.default_rng(0)
    off = [feel(side, POSTURES["ready"], tau + rng.normal(0.0, 0.5, len(tau))) for _ in range(200)]
    assert np.std(off, axis=0).max() < 1.7


def feel(world: Any, force: float) -> None:
    """Let the motors of the right arm report that the hand pulls upwards."""
    q, tau = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)
    q[UPPER], tau[UPPER] = POSTURES["ready"], torques("right", force * UP)
    imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.zeros(3))
    world.bus.publish(topics.LOW_STATE, LowState(world.t, q, np.zeros(NUM_JOINTS), tau, imu), world.t)
    world.step()


def test_a_force_that_lasts_is_noticed_and_a_jerk_is_not(world: Any) -> None:
    feel(world, 5.0)
    guard = ForceGuard(world.context, "right", UP, force=10.0, length=0.015)
    for force in (5.0, 5.0, 40.0, 5.0, 5.0, 5.0, 5.0):  # 5 N were there before
        feel(world, force)
        assert not guard()
    for _ in range(TICKS):
        feel(world, 17.0)
        stuck = guard()
    assert stuck and guard.stuck and guard.largest == pytest.approx(12.0, abs=0.1)


def test_the_force_of_a_hand_that_goes_on_is_that_of_its_own_acceleration(world: Any) -> None:
    feel(world, 0.0)
    guard = ForceGuard(world.context, "right", UP, force=10.0)
    for _ in range(4 * TICKS):
        world.kinematics.offset += (0.0, 0.0, 0.0015)
        feel(world, 30.0)
        assert not guard()
    for _ in range(TICKS):
        feel(world, 30.0)
        stuck = guard()
    assert stuck


def test_beyond_its_length_nothing_is_asked(world: Any) -> None:
    feel(world, 0.0)
    guard = ForceGuard(world.context, "right", UP, force=10.0, length=0.015)
    T = world.context.arms["right"].pose
    T[2, 3] += 0.02
    world.context.arms["right"].stays_at(T)
    for _ in range(2 * TICKS):
        feel(world, 30.0)
        assert not guard()


def test_motors_that_do_not_report_feel_nothing(world: Any) -> None:
    guard = ForceGuard(world.context, "right", UP, force=1.0)
    assert not guard() and guard.largest == 0.0


def test_what_is_there_before_is_averaged_over_the_rest(world: Any) -> None:
    feel(world, 0.0)
    resting = ForceGuard.at_rest(world.context, "right", UP, force=10.0)
    with pytest.raises(StopIteration) as end:
        for k in range(REST + 2):
            resting.send(None)
            feel(world, 8.0 if k % 2 else 2.0)
    guard = end.value.value
    for _ in range(TICKS):
        feel(world, 17.0)
        guard()
    assert guard.stuck and guard.largest == pytest.approx(12.0, abs=0.5)


def test_what_the_arm_takes_for_itself_on_the_lead_is_no_contact(world: Any) -> None:
    feel(world, 0.0)
    guard = ForceGuard(world.context, "right", UP, force=8.0, lead=0.02)

    def rise(force: float, way: float) -> bool:
        T = world.context.arms["right"].commanded.copy()
        T[2, 3] += way
        world.context.arms["right"].stays_at(T)
        feel(world, force)
        return guard()

    assert not any(rise(10.0, 0.0005) for _ in range(60))
    assert any(rise(19.0, 0.0005) for _ in range(2 * TICKS)) and guard.stuck


def test_on_the_lead_a_wall_is_a_contact(world: Any) -> None:
    feel(world, 0.0)
    guard = ForceGuard(world.context, "right", UP, force=8.0, lead=0.02)
    for _ in range(2 * TICKS):
        feel(world, 30.0)
        guard()
    assert guard.stuck
