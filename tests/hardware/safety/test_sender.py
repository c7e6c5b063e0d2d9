"""A sender that lets motors go, or shakes them, is found out; one that is merely strong is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.sender import SenderMemory, examine_command, ungrasped
from golem.interfaces.payloads import Fault, Reason
from golem.types import LEGS, UPPER, LowCommand

LIMITS = SafetyLimits.from_profile()


def command(k: int, kp: float = 100.0, kd: float = 3.0, tau: float = 0.0) -> LowCommand:
    zeros, ones = np.zeros(27), np.ones(27)
    return LowCommand(0.002 * k, zeros, zeros, tau * ones, kp * ones, kd * ones)


def run(*commands: LowCommand) -> tuple[list[bool], Fault | None]:
    memory, followed, fault = SenderMemory(), list[bool](), None
    for each in commands:
        memory, follow, fault = examine_command(each, memory, LIMITS)
        followed.append(follow)
    return followed, fault


def test_a_motor_that_was_held_is_not_let_go() -> None:
    limp = command(1, 0.0, 0.0)
    assert run(command(0), limp) == ([True, False], None)
    _, fault = run(command(0), limp, limp, limp)
    assert fault is not None and fault.reason is Reason.COMMAND_GAINS


@pytest.mark.parametrize(
    ("fed", "soft"), [((), (0, 1)), ((3,), (1,)), ((3, 9), ())], ids=["no leg", "one leg", "both legs"]
)
def test_a_leg_that_carries_is_stiff_or_fed_forward_as_a_whole(fed: tuple[int, ...], soft: tuple[int, ...]) -> None:
    """Joints 3 and 9 are the knees; at the other joints a torque that balances may be anything, nothing too."""
    torques = np.zeros(27)
    torques[list(fed)] = -20.0
    limp = replace(command(1, kp=0.0), tau=torques)
    found = ungrasped(limp, LIMITS)[1]
    assert [bool(leg.all()) for leg in found[LEGS].reshape(2, 6)] == [k in soft for k in (0, 1)]
    assert found.any() == bool(soft) and not found[UPPER].any()
    memory, fault = SenderMemory(), None
    for k in range(4):
        memory, _, fault = examine_command(replace(limp, t=0.002 * k), memory, LIMITS, carries=True, late=True)
    assert (fault is not None and fault.reason is Reason.COMMAND_GAINS) == bool(soft)


def test_motors_that_were_never_held_may_be_limp() -> None:
    limp = command(0, 0.0, 0.0)
    assert run(*[limp] * 10)[1] is None


def test_negative_gains_are_a_fault_of_the_sender() -> None:
    _, fault = run(*[command(0, kp=-1.0)] * 3)
    assert fault is not None and fault.reason is Reason.COMMAND_GAINS


def test_torques_that_jump_to_and_fro_are_a_fault_and_one_jump_is_none() -> None:
    assert run(command(0, tau=10.0), *[command(1, tau=-10.0)] * 20)[1] is None
    _, fault = run(*[command(k, tau=10.0 * (-1) ** k) for k in range(4)])
    assert fault is not None and fault.reason is Reason.COMMAND_JOLTS


def test_an_arms_position_that_jumps_is_a_torque_that_does() -> None:
    def at(k: int, q: float) -> LowCommand:
        q27 = np.zeros(27)
        q27[UPPER] = q
        return replace(command(k), q=q27)

    assert run(*[at(k, 0.001 * k) for k in range(300)])[1] is None
    _, fault = run(*[at(k, 1.0 * (k // 50 % 2)) for k in range(151)])
    assert fault is not None and fault.reason is Reason.COMMAND_JOLTS


def test_legs_may_ask_for_positions_that_jump() -> None:
    def at(k: int) -> LowCommand:
        q = np.zeros(27)
        q[LEGS] = 1.0 * (k // 10 % 2)
        return replace(command(k), q=q)

    assert run(*[at(k) for k in range(151)])[1] is None


@pytest.mark.parametrize("field", ["q", "dq", "tau", "kp", "kd"])
def test_what_no_sender_could_mean_is_not_followed_and_the_third_is_a_fault(field: str) -> None:
    far = replace(command(1), **{field: np.full(27, 1e5)})
    assert run(command(0), far, command(2)) == ([True, False, True], None)
    _, fault = run(command(0), far, far, far)
    assert fault is not None and fault.reason is Reason.COMMAND_BEYOND and f"with {field} 1" in fault.detail


def test_ten_times_what_a_joint_may_do_is_merely_limited() -> None:
    assert run(*[replace(command(1), q=np.full(27, 4.0), kp=np.full(27, 900.0))] * 10)[1] is None


def legs(q: float = 0.0, dq: float = 0.0, tau: float = 0.0, which: slice = LEGS) -> LowCommand:
    """A command whose legs get targets by `q` [rad], and speed and torque in shares of their limits."""
    new = replace(command(1), q=np.zeros(27), dq=np.zeros(27), tau=np.zeros(27), kd=np.full(27, 5.0))
    new.q[which], new.dq[which], new.tau[which] = q, dq * LIMITS.velocity[which], tau * LIMITS.torque[which]
    return new


@pytest.mark.parametrize(
    ("thrown", "needed"),
    [
        (legs(tau=1.1), LIMITS.samples),
        (legs(tau=-1.1, which=slice(3, 4)), LIMITS.samples),
        (legs(dq=1.0), LIMITS.samples),
        (legs(q=1.0), LIMITS.throws),
    ],
    ids=["torque of all", "torque of a knee", "speed of all", "position of all"],
)
def test_legs_are_not_thrown_and_a_run_of_such_commands_is_a_fault(thrown: LowCommand, needed: int) -> None:
    rest, few = legs(), [thrown] * (needed - 1)
    followed = [True] + ([False] * len(few) + [True]) * 2
    assert run(rest, *few, rest, *few, rest) == (followed, None)
    _, fault = run(rest, *few, thrown)
    assert fault is not None and fault.reason is Reason.COMMAND_JOLTS


def test_one_leg_may_ask_for_more_than_a_motor_has_and_not_thrice_in_half_a_second() -> None:
    step = legs(q=1.1 * LIMITS.torque[3] / 100.0, which=slice(3, 4))
    rest = legs()
    assert run(rest, step, *[step] * 400, rest)[1] is None
    _, fault = run(rest, step, rest, step)
    assert fault is not None and fault.reason is Reason.COMMAND_JOLTS
