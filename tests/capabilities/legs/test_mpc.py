from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from tests.capabilities.legs.floor_plant import FloorPlant

from golem import registry
from golem.capabilities.legs.base import STANDING, Envelope, LowerBody
from golem.capabilities.legs.mpc.controller import FAILURES, MPC, Method, MPCConfig, PlannerConfig, PlanningError
from golem.errors import ConfigError
from golem.evaluation.harness.copies import CAN_COPY, in_a_copy
from golem.finite import NotFinite
from golem.types import Array

QUICK = MPCConfig(threads=0, plan_rate=25.0)


def test_is_a_lower_body_that_stands() -> None:
    legs = registry.create("lower_body", "mpc", {"planner": {"samples": 8}, "threads": 0})
    assert isinstance(legs, LowerBody) and isinstance(legs, MPC)
    assert legs.envelope == Envelope(height=legs.envelope.height) and legs.gait.start == "never"
    assert legs.latency == MPCConfig().latency


PUSH = (0.2, 0.2, np.array([-40.0, 0.0, 0.0]))


@pytest.mark.parametrize("method", get_args(Method))
def test_stands_through_a_light_push_with_a_noisy_estimate(method: Method) -> None:
    legs = MPC(replace(QUICK, planner=PlannerConfig(method=method)))
    assert FloorPlant(velocity_noise=0.03).run(legs, 2.5, PUSH)


def test_standing_is_its_doing() -> None:
    # The same gains at the same posture, without plans, tip over.
    never = replace(QUICK, planner=PlannerConfig(noise=(1e-9,) * 6))
    assert not FloorPlant(velocity_noise=0.03).run(MPC(never), 2.5, PUSH)


def test_a_robot_of_which_no_rollout_is_finite_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings where it is called
    legs, plant = MPC(QUICK), FloorPlant()
    state, base = plant.sense()
    legs.reset(state)
    lost = replace(base, velocity=np.full(3, 1e200))  # finite, and its rollouts are not
    for _ in range(FAILURES - 1):
        legs.step(state, lost, STANDING, 0.04)
    with pytest.raises(PlanningError, match="finite for 5 plans in a row"):
        legs.step(state, lost, STANDING, 0.04)
    legs.reset(state)
    legs.step(state, base, STANDING, 0.04)


def test_an_estimate_that_is_not_finite_is_refused_at_once() -> None:
    legs, plant = MPC(QUICK), FloorPlant()
    state, base = plant.sense()
    legs.reset(state)
    with pytest.raises(NotFinite, match="the velocity of the base"):
        legs.step(state, replace(base, velocity=np.full(3, np.nan)), STANDING, 0.04)


def commands(legs: MPC, ticks: int = 6) -> Array:
    plant = FloorPlant(seed=3)
    legs.reset(plant.sense()[0])
    return np.array([legs.step(*plant.sense(), STANDING, 0.02).q for _ in range(ticks)])


def test_a_reset_repeats_everything_and_the_seed_changes_it() -> None:
    legs = MPC(QUICK)
    first = commands(legs)
    np.testing.assert_array_equal(commands(legs), first)
    np.testing.assert_array_equal(commands(MPC(replace(QUICK, threads=2))), first)
    assert not np.array_equal(commands(MPC(replace(QUICK, planner=PlannerConfig(seed=1)))), first)


@pytest.mark.skipif(not CAN_COPY, reason="the system cannot go on in a copy of a process")
@pytest.mark.timeout(60)
def test_a_copy_of_the_process_plans_on_without_the_threads_that_it_left_behind() -> None:
    legs = MPC(replace(QUICK, threads=2))
    first = commands(legs)
    np.testing.assert_array_equal(in_a_copy(lambda: commands(legs)), first)
    np.testing.assert_array_equal(commands(legs), first)


def test_between_plans_the_present_one_is_followed_to_where_the_command_arrives() -> None:
    plant = FloorPlant()
    legs = MPC(replace(QUICK, rate=50.0, latency=0.02))
    state, base = plant.sense()
    legs.reset(state)
    legs.step(state, base, STANDING, 0.02)
    plan = legs.planner.targets(np.array([0.02, 0.04, 0.06]))
    second = legs.step(state, base, STANDING, 0.02)  # no new plan is due
    np.testing.assert_allclose(second.q, plan[1], atol=1e-12)
    third = legs.step(state, base, STANDING, 0.02)
    assert not np.allclose(third.q, plan[2])


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        (replace(QUICK, stance="crouhc"), "crouch"),
        (replace(QUICK, kp=(1.0,)), "six"),
        (replace(QUICK, timestep=2.0), "timestep"),
        (replace(QUICK, plan_rate=100.0), "plan_rate"),
    ],
)
def test_wrong_options_are_named(wrong: MPCConfig, word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        MPC(wrong)
