# ruff: noqa: E402 (nothing of the trainer can be imported where torch is absent)
from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs the extra 'train'")

from golem.capabilities.legs.description import SHIPPED
from golem.capabilities.legs.gait import GaitConfig
from golem.hardware.safety.base import SafetyLimits
from golem.training.legs.batch_world import BatchWorld, WorldConfig
from golem.training.legs.disturbances import Difficulty
from golem.training.legs.env import PERIOD, TASKS, EnvConfig, LegsEnv, landing_errors
from golem.training.legs.export_policy import load_actor
from golem.training.legs.rewards import RewardWeights
from golem.training.legs.training_model import KP, STANCE

NOBODY = np.arange(0)


def run(seed: int, threads: int, steps: int = 10) -> tuple[np.ndarray, np.ndarray]:
    env = LegsEnv(6, EnvConfig(), seed, threads)
    rng = np.random.default_rng(1)
    rewards = []
    for _ in range(steps):
        step = env.step(rng.normal(0.0, 0.5, (6, 12)), NOBODY, np.zeros((0, 15)))
        env.restart(np.flatnonzero(step.ended | step.truncated))
        rewards.append(step.reward)
    return env.observe()[0], np.array(rewards)


def test_the_same_seed_gives_the_same_episodes_on_any_number_of_threads() -> None:
    one, two, other = run(0, 1), run(0, 2), run(1, 1)
    np.testing.assert_array_equal(one[0], two[0])
    np.testing.assert_array_equal(one[1], two[1])
    assert not np.array_equal(one[0], other[0])


def test_the_estimator_in_the_loop_follows_the_truth() -> None:
    env = LegsEnv(16, EnvConfig(gait=GaitConfig(start="never")), 0, 1)
    for _ in range(20):
        env.step(np.zeros((16, 12)), NOBODY, np.zeros((0, 15)))
    world = env.world
    planted = (world.truth.force > 200.0).all(axis=1)
    assert planted.sum() >= 4
    error = np.linalg.norm(world.sensed.velocity - world.truth.velocity, axis=1)[planted]
    assert 0.0 < np.median(error) < 0.08


def test_a_robot_that_lies_down_ends_its_episode_and_starts_anew() -> None:
    env = LegsEnv(4, EnvConfig(), 0, 1)
    collapse = np.tile((np.tile([0.0, -1.0, 0.0, 2.0, -0.8, 0.0], 2) - STANCE) / 0.25, (4, 1))
    for _ in range(150):
        step = env.step(collapse, NOBODY, np.zeros((0, 15)))
        if step.ended.any():
            break
    assert step.ended.any()
    fallen = np.flatnonzero(step.ended)
    env.restart(fallen)
    assert (env.age[fallen] == 0.0).all()
    np.testing.assert_allclose(env.world.truth.height[fallen], 0.97, atol=0.03)


def test_a_robot_that_diverges_is_a_fall_and_teaches_nothing_that_is_not_a_number() -> None:
    env = LegsEnv(4, EnvConfig(), 0, 1)
    true_rewards = env._rewards

    def rewards(*args: Any) -> tuple[Any, Any]:
        reward, terms = true_rewards(*args)
        reward[2] = np.nan
        return reward, terms

    env._rewards = rewards  # pyright: ignore[reportAttributeAccessIssue]
    step = env.step(np.zeros((4, 12)), NOBODY, np.zeros((0, 15)))
    assert step.ended.tolist() == [False, False, True, False]
    assert step.reward[2] == -EnvConfig().fall and np.isfinite(step.reward).all()


def test_the_speed_that_stops_a_robot_has_its_price_where_nothing_is_left_to_lose() -> None:
    env = LegsEnv(2, EnvConfig(), 0, 1)
    truth, still = env.world.truth, np.zeros((2, 3))
    truth.R[:, 2] = [0.9, 0.0, np.sqrt(1.0 - 0.81)]
    truth.dq[:] = 0.0
    truth.dq[1, 3] = 16.0
    idle = np.zeros((2, 12))
    above = 16.0 - 0.7 * SafetyLimits.from_profile().velocity[3]
    for strictness in (0.0, 0.5, 1.0):
        known = (idle, idle, still[:, :2], np.full(2, 0.5), np.zeros((2, 2)), np.zeros(2, dtype=bool))
        reward, _ = env._rewards(truth, still, env.gait, *known, strictness, PERIOD)
        np.testing.assert_allclose(reward, [0.0, strictness * RewardWeights().fast * above * PERIOD])


def test_who_was_pushed_need_not_follow_the_command_and_pays_for_feet_that_drag() -> None:
    env = LegsEnv(2, EnvConfig(), 0, 1)
    truth, ahead, idle = env.world.truth, np.tile([0.4, 0.0, 0.0], (2, 1)), np.zeros((2, 12))
    truth.force[:] = 300.0
    env.gait.stepping[:] = True
    env.gait.phase[:] = 0.775  # the left leg is in the middle of its swing
    known = (idle, idle, np.zeros((2, 2)), np.zeros(2), np.zeros((2, 2)), np.array([True, False]))
    reward, terms = env._rewards(truth, ahead, env.gait, *known, 1.0, PERIOD)
    dragged = RewardWeights().dragged
    assert reward[0] > reward[1] and terms["dragged"] == 0.5 * dragged
    truth.R[:, 2] = [0.9, 0.0, np.sqrt(1.0 - 0.81)]  # about to fall: nothing else is left to lose
    truth.velocity[:] = 9.0
    for strictness in (0.0, 1.0):
        reward, _ = env._rewards(truth, ahead, env.gait, *known, strictness, PERIOD)
        np.testing.assert_allclose(reward, 0.5 * dragged * strictness * PERIOD)


def test_a_robot_that_walks_lands_its_feet_where_the_capture_point_says() -> None:
    actor = load_actor(SHIPPED / "almi_walk.onnx")
    env = LegsEnv(8, EnvConfig(), 0, 1)
    env.difficulty = Difficulty(amplitude=0.0, speed=0.0, push=0.0)
    env.restart(np.arange(8))
    env.command(np.array([0.4, 0.0, 0.0]))
    landing, lifted = list[float](), list[float]()
    for k in range(150):
        with torch.no_grad():
            action = actor(torch.from_numpy(env.observe()[0]).float()).double().numpy()
        env.step(action, NOBODY, np.zeros((0, 15)))
        swing = (env.gait.phases - env.gait.config.stance) / (1.0 - env.gait.config.stance)
        error = landing_errors(env.world.truth, env.twist, env.gait)
        if k > 75:
            landing.extend(error[swing > 0.9])
            lifted.extend(error[(swing > 0.0) & (swing < 0.1)])
    assert np.mean(landing) < 0.06 < 0.1 < np.mean(lifted)


def test_a_run_that_goes_on_meets_other_draws_and_the_same_ones_each_time() -> None:
    def begins(*seed: int) -> np.ndarray:
        env = LegsEnv(6, EnvConfig(), 0, 1)
        env.reseed(seed)
        return env.world.friction

    np.testing.assert_array_equal(begins(0, 500), begins(0, 500))
    assert not np.array_equal(begins(0, 500), begins(0, 1000))
    assert not np.array_equal(begins(0, 500), begins(1, 500))


def test_commands_stay_inside_the_trained_envelope_and_change_slowly() -> None:
    env = LegsEnv(32, EnvConfig(hold=(0.1, 0.2)), 0, 1)
    maximum = np.array(env.config.accelerate) * PERIOD
    before = env.twist.copy()
    for _ in range(40):
        step = env.step(np.zeros((32, 12)), NOBODY, np.zeros((0, 15)))
        # On the way to a stop a command ends at the dead band of 0.1.
        assert (np.abs(env.twist - before) <= np.maximum(maximum, 0.1 + maximum) + 1e-12).all()
        env.restart(np.flatnonzero(step.ended | step.truncated))
        before = env.twist.copy()
    low, high = np.array([env.config.envelope.vx, env.config.envelope.vy, env.config.envelope.wz]).T
    assert (env.twist >= low).all() and (env.twist <= high).all() and np.abs(env.twist).max() > 0.1


def test_slope_turns_gravity_and_roughness_lifts_soles() -> None:
    config = EnvConfig(world=WorldConfig(slope=0.1, roughness=0.02))
    world = LegsEnv(32, config, 0, 1).world
    sloped = np.abs(world.slope).sum(axis=1) > 0.0
    assert 4 < sloped.sum() < 28
    before = world._corners.copy()
    world.shim(np.ones((32, 2), dtype=bool))
    moved = np.abs(world._corners - before)
    assert 0.0 < moved.max() <= 0.021
    changed = np.unique(np.nonzero(moved)[1])
    assert set(changed) <= set(world.ids.soles)


def test_rough_ground_has_whole_steps_and_is_often_slippery() -> None:
    rough = replace(TASKS["rough"].world, roughness=0.0)
    world = BatchWorld(400, rough, np.random.default_rng(0), 1)
    world.reset(np.arange(400), np.zeros((400, 15)), 0.0)
    low, high = rough.friction
    assert ((world.friction - low) / (high - low) < 0.1).mean() == pytest.approx(0.325, abs=0.06)
    before = world._corners.copy()
    world.shim(np.ones((400, 2), dtype=bool))
    raised = (before - world._corners)[:, world.ids.soles, 2][:, ::4][world._rough > 0.0]
    assert raised.min() > -1e-12 and raised.max() == pytest.approx(rough.ledge)
    assert np.isclose(raised, rough.ledge).mean() == pytest.approx(0.25, abs=0.05)


EVEN = WorldConfig(slope=0.0, roughness=0.0, torso_mass=(0.0, 0.0), leg_offset=0.0)


def standing(world: WorldConfig, payload: float) -> tuple[LegsEnv, np.ndarray, np.ndarray]:
    """Let the shipped network stand for two seconds, arms at rest.

    Returns:
        The robots, the weight on the feet of each (n,) [N], and which of them stood (m,), after the first second
        without a step.
    """
    env = LegsEnv(16, replace(TASKS["stand"], world=world), 0, 1)
    env.difficulty = Difficulty(amplitude=0.0, speed=0.0, push=0.0, payload=payload)
    env.restart(np.arange(16))
    actor, weight, stood = load_actor(SHIPPED / "almi_stand.onnx"), [], np.ones(16, dtype=bool)
    for step in range(100):
        with torch.no_grad():
            actions = actor(torch.from_numpy(env.observe()[0]).float()).double().numpy()
        stood &= ~env.step(actions, NOBODY, np.zeros((0, 15))).ended & ~(env.gait.stepping & (step > 50))
        weight.append(env.world.truth.force.sum(axis=1))
    assert stood.sum() >= 12
    return env, np.mean(weight[50:], axis=0), np.flatnonzero(stood)


def test_payloads_weigh_on_the_feet() -> None:
    env, weight, stood = standing(EVEN, payload=1.0)
    carried, weight = env.world.payload.sum(axis=1)[stood], weight[stood]
    assert carried.min() < 0.1 and 3.0 < carried.max() <= 6.0
    np.testing.assert_allclose((weight - weight[carried < 0.1].mean()) / 9.81, carried, atol=0.5)


def test_weak_motors_need_a_larger_error_for_the_same_torque() -> None:
    for strength in (0.88, 1.1):
        env, _, stood = standing(replace(EVEN, strength=(strength, strength)), payload=0.0)
        truth, knee = env.world.truth, 3
        stiffness = truth.torque[:, knee] / (env.world._ctrl[:, knee] - truth.q[:, knee])
        np.testing.assert_allclose(stiffness[stood] / KP[knee], strength, rtol=0.1)


def test_commands_come_late_by_each_robots_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    world = LegsEnv(4, EnvConfig(), 0, 1).world
    world._delay[:], world._offset[:] = np.arange(4), 0.0
    seen: list[np.ndarray] = []

    def limit(legs: np.ndarray, delay: np.ndarray) -> np.ndarray:
        seen.append(legs[:, 0].copy())
        return legs

    monkeypatch.setattr(world._gate, "limit", limit)
    targets = np.array([0.01, 0.02, 0.03])
    for target in targets:
        world.step(np.full((4, 12), target), np.zeros((4, 15)), np.zeros((4, 3)), np.zeros(4, dtype=bool), 2)
    told = np.repeat(np.append(STANCE[0], targets), [4, 2, 2, 2])  # what was meant at each physics step
    for delay in range(4):
        np.testing.assert_allclose([row[delay] for row in seen], told[4 - delay : 10 - delay])
