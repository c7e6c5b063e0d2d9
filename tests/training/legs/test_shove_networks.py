# ruff: noqa: E402 (nothing of the trainer can be imported where torch is absent)
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs the extra 'train'")

from golem.errors import ConfigError
from golem.robots.mujoco.shoves import DIRECTIONS
from golem.training.legs.checkpoint import CHECKPOINT
from golem.training.legs.disturbances import RandomPushes
from golem.training.legs.shove_networks import shove_all
from golem.training.legs.train_legs import TrainLegsConfig, train


def test_every_robot_that_is_shoved_too_hard_is_lost_and_counted_once(tmp_path: Path) -> None:
    train(TrainLegsConfig(out=tmp_path, task="stand", robots=8, steps=8 * 24))
    found = shove_all(tmp_path / CHECKPOINT, 900.0, n=2, seed=0, threads=1)
    assert [row.direction for row in found] == list(DIRECTIONS)
    assert all((row.survived, row.stopped + row.fell) == (0, 2) for row in found)
    with pytest.raises(ConfigError, match="--impulse more than 0"):
        shove_all(tmp_path / CHECKPOINT, 0.0, n=2, seed=0, threads=1)


def test_a_push_that_is_ordered_comes_once_and_no_other() -> None:
    pushes = RandomPushes(2, 50.0, (0.25, 0.25, 0.25, 0.25), np.random.default_rng(0))
    pushes.reset(np.arange(2), 1.0, np.zeros(2, dtype=bool))
    pushes.once(np.array([[100.0, 0.0], [0.0, -200.0]]), 0.2, start=0.5)
    facing = np.tile(np.eye(2), (2, 1, 1))
    impulse = np.zeros((2, 2))
    for _ in range(3000):
        pushes.step(1.0, facing, 0.01)
        impulse += pushes.force[:, :2] * 0.01
        assert pushes.on_torso.all() or not pushes.force.any()
    np.testing.assert_allclose(impulse, [[20.0, 0.0], [0.0, -40.0]], atol=2.1)  # to a tick
