"""Robots in several processes are the robots of as many environments, bit for bit."""

from __future__ import annotations

import os
import signal
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from golem.errors import ConfigError, GolemError
from golem.training.legs.disturbances import Difficulty
from golem.training.legs.env import SEEN, TASKS, LegsEnv
from golem.training.legs.sharded_env import ShardedEnv

TASK = replace(TASKS["rough"], episode=0.3)  # so that some episodes end
HARD = Difficulty(1.0, 1.0, 1.0, 1.0, 1.0)
STEERED = 3
STEPS = 20


def orders(n: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(5)
    return [(rng.normal(0.0, 0.5, (n, 12)), rng.normal(0.0, 0.5, (n, 15))) for _ in range(STEPS)]


def plain(seed: tuple[int, ...], robots: slice, again: tuple[int, ...], n: int) -> list[np.ndarray]:
    """Return what a `LegsEnv` on its own sees and is paid where the first `STEERED` of `n` robots are steered."""
    env = LegsEnv(robots.stop - robots.start, TASK, seed, 1)
    env.difficulty = HARD
    out, steered = [*env.observe()], np.flatnonzero(np.arange(n)[robots] < STEERED)
    for action, speeds in orders(n):
        step = env.step(action[robots], steered, speeds[robots][steered])
        over = step.ended | step.truncated
        out += [step.reward, step.ended, step.truncated, env.age.copy(), env.walking, env.gait.stepping.copy()]
        env.restart(np.flatnonzero(over))
        out += [*env.observe()]
    env.reseed(again)
    return [*out, *env.observe()]


def sharded(n: int, shards: int) -> tuple[list[np.ndarray], float]:
    with closing(ShardedEnv(n, TASK, 7, shards)) as env:
        env.difficulty = HARD
        rows = env.rows
        rows["steered"][:STEERED] = True
        out = [rows[name].copy() for name in ("observed", "known")]
        for rows["action"], rows["speeds"] in orders(n):
            env.step()
            names = ("reward", "ended", "truncated", "age", "walking", "stepping", "observed", "known")
            out += [rows[name].copy() for name in names]
        assert env.terms["alive"] == pytest.approx(TASK.weights.alive)
        env.reseed(100)
        return [*out, rows["observed"].copy(), rows["known"].copy()], env.cpu


def test_one_shard_is_the_environment_itself() -> None:
    alone, cpu = sharded(6, 1)
    expected = plain((7,), slice(0, 6), (7, 100), 6)
    assert any(step.any() for step in expected[4::8])  # some were cut
    for mine, theirs in zip(alone, expected, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert alone[0].shape == (6, SEEN.size) and cpu == 0.0


@pytest.mark.slow
def test_shards_are_as_many_environments_with_seeds_of_their_own() -> None:
    found, cpu = sharded(8, 2)
    one, two = (plain((7, k), slice(4 * k, 4 * k + 4), (7, 100, k), 8) for k in range(2))
    for mine, first, second in zip(found, one, two, strict=True):
        np.testing.assert_array_equal(mine, np.concatenate([first, second]))
    assert not np.array_equal(one[0], two[0]) and cpu > 0.0


@pytest.mark.slow
def test_a_process_that_dies_is_one_sentence_and_the_others_end() -> None:
    with pytest.raises(ConfigError, match="a divisor of the number of robots, 8, not 3"):
        ShardedEnv(8, TASK, 0, 3)
    env = ShardedEnv(8, TASK, 0, 2)
    processes = env._processes
    os.kill(processes[1].pid or 0, signal.SIGKILL)
    with pytest.raises(GolemError, match=r"Shard 2 of 2 of the training has died \(exit code -9\)"):
        env.step()
    env.close()
    env.close()
    assert not any(process.is_alive() for process in processes) and processes[1].exitcode == -9
