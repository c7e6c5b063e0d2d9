from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

gym = pytest.importorskip("gymnasium")

from golem.datasets.gym_env import ACTIONS, RUNGS, GolemEnv  # noqa: E402
from golem.errors import ConfigError, GolemError  # noqa: E402
from golem.evaluation.base import TrialSpec, rung_class  # noqa: E402
from golem.evaluation.episodes.oracle import Oracle  # noqa: E402

SHORT: dict[str, Any] = {"limit": 0.3, "period": 0.05}


def test_the_names_are_known() -> None:
    assert {f"golem/{rung}-v0" for rung in RUNGS} <= set(gym.registry)
    with pytest.raises(GolemError, match="walk-twist"):
        GolemEnv("walk-twist")
    with pytest.raises(ConfigError, match="0.01 to 1 s"):
        GolemEnv(period=3.0)


@pytest.mark.slow
def test_the_official_checker_has_nothing_to_say() -> None:
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*(not within|deprecated|spec).*")
        check_env(gym.make("golem/tether-v0", **SHORT).unwrapped, skip_render_check=True)


@pytest.mark.slow
def test_a_seed_is_the_scene_of_that_trial_of_the_ladder() -> None:
    scenes: list[np.ndarray] = []

    def look(running: Any, robot: Any) -> None:
        oracle = Oracle(robot)
        scenes.append(oracle.screw_heads())
        oracle.close()
        raise KeyboardInterrupt

    rung = rung_class("tether")()
    rung.onlooker = look
    with pytest.raises(KeyboardInterrupt):
        rung.run(TrialSpec("tether", "visual_servo", "field", 0, 7), None)
    env = GolemEnv(**SHORT)
    try:
        before = Oracle.__init__
        heads: list[np.ndarray] = []

        def init(self: Any, robot: Any) -> None:
            before(self, robot)
            heads.append(self.screw_heads())

        Oracle.__init__ = init  # the environment's own judge sees the scene first
        try:
            env.reset(seed=7)
        finally:
            Oracle.__init__ = before
    finally:
        env.close()
    np.testing.assert_array_equal(heads[0], scenes[0])


@pytest.mark.slow
def test_an_episode_ends_with_its_time_and_repeats_itself() -> None:
    env = GolemEnv(cameras=("right_hand",), **SHORT)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(np.zeros(len(ACTIONS)))
    runs: list[list[Any]] = []
    for _ in range(2):
        first, info = env.reset(seed=3)
        assert info == {"trial": 3} and first["image_right_hand"].shape == (54, 96, 3)
        rows, action = [first], np.zeros(len(ACTIONS))
        action[8] = -1.0  # the right hand goes down
        while True:
            seen, reward, terminated, truncated, info = env.step(action)
            assert env.observation_space.contains(seen)
            rows.append(seen)
            if terminated or truncated:
                break
        assert (reward, terminated, truncated, info["success"]) == (0.0, False, True, False)
        assert len(rows) == 7
        runs.append(rows)
    for a, b in zip(*runs, strict=True):
        assert all(np.array_equal(a[name], b[name]) for name in a)
    assert runs[0][-1]["palms"][11] < runs[0][0]["palms"][11] - 0.005
    # The last observation is what the last action led to.
    assert not np.array_equal(runs[0][-1]["q"], runs[0][-2]["q"])
    env.reset(seed=3)
    for wrong in (np.zeros(3), np.full(len(ACTIONS), np.nan)):
        with pytest.raises(ConfigError, match="finite numbers"):
            env.step(wrong)
    env.close()
    env.close()


@pytest.mark.slow
def test_environments_run_side_by_side() -> None:
    many = gym.make_vec("golem/tether-v0", num_envs=2, vectorization_mode="sync", **SHORT)
    seen, _ = many.reset(seed=5)
    assert seen["q"].shape == (2, 27)
    seen, rewards, *_ = many.step(many.action_space.sample())
    assert rewards.shape == (2,)
    many.close()


@pytest.mark.slow
def test_the_judge_of_the_rung_says_when_it_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []
    before = Oracle.screws_in_tray

    def in_tray(self: Oracle) -> Any:
        calls.append(1)
        return [0] if len(calls) > 3 else before(self)

    monkeypatch.setattr(Oracle, "screws_in_tray", in_tray)
    env = GolemEnv(period=0.05, limit=5.0)
    env.reset(seed=1)
    for _ in range(10):
        _, reward, terminated, truncated, info = env.step(np.zeros(len(ACTIONS)))
        if terminated:
            break
    env.close()
    assert (reward, terminated, truncated, info["success"]) == (1.0, True, False, True)
