"""Shoves in the training's own world: what a network can stand, in seconds, before the twin is asked for an hour.

It is harder there than in the twin, because soles are slippery, floors slope and commands come late by up to 40 ms; so
the figures compare networks, and say little by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from golem.errors import ConfigError
from golem.robots.mujoco.shoves import DIRECTIONS, SHOVE_TIME
from golem.training.legs.env import PERIOD, TASKS, LegsEnv
from golem.training.legs.export_policy import load_actor

SETTLE, PATIENCE = 2.0, 3.0
"""Time of standing or walking before the shove, and time after its begin [s]; both have to be survived."""
NO_ROBOT = np.arange(0)


@dataclass(frozen=True, slots=True)
class Shoved:
    """What became of the robots that were shoved in one direction.

    Attributes:
        direction: name in `DIRECTIONS`.
        survived, stopped, fell: how many stood it, were stopped by the safety gate, and fell.
    """

    direction: str
    survived: int
    stopped: int
    fell: int


def shove_all(network: Path, impulse: float, n: int, seed: int, threads: int, speed: float = 0.0) -> list[Shoved]:
    """Shove `n` robots in each direction once, arms at rest, without exploration.

    Args:
        network: checkpoint of a training run, or an exported network.
        impulse: of each shove on the torso [N s].
        n: robots per direction.
        seed: of the robots.
        threads: of the physics.
        speed: at which the robots walk ahead in the world of the walking task, shoved at any moment of their gait; 0
            stands in that of the standing task [m/s].

    Raises:
        ConfigError: it is neither, or a number is not positive.
    """
    if impulse <= 0.0 or n < 1 or threads < 1 or seed < 0:
        raise ConfigError("Give --impulse more than 0, -n 1 or more, --threads 1 or more and --seed 0 or more.")
    torch.set_num_threads(1)
    actor = load_actor(network)
    task = TASKS["walk" if speed else "stand"]
    env = LegsEnv(n * len(DIRECTIONS), task, seed, threads)
    env.difficulty.amplitude = env.difficulty.speed = env.difficulty.payload = 0.0
    env.restart(np.arange(env.n))
    angle = np.repeat(np.arange(len(DIRECTIONS)) * np.pi / 4.0, n)
    env.command(np.array([speed, 0.0, 0.0]))
    moment = np.tile(np.linspace(0.0, task.gait.period if speed else 0.0, n, endpoint=False), len(DIRECTIONS))
    force = impulse / SHOVE_TIME * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    env.shove(force, SHOVE_TIME, SETTLE + moment)
    stopped, fell = np.zeros(env.n, dtype=bool), np.zeros(env.n, dtype=bool)
    for _ in range(round((SETTLE + moment.max() + PATIENCE) / PERIOD)):
        seen = torch.from_numpy(env.observe()[0]).float()
        with torch.no_grad():
            step = env.step(actor(seen).double().numpy(), NO_ROBOT, np.zeros((0, 15)))
        lost = step.ended & ~stopped & ~fell
        stopped |= lost & env.world.stopped
        fell |= lost & ~env.world.stopped
    rows = np.stack([~stopped & ~fell, stopped, fell]).reshape(3, len(DIRECTIONS), n).sum(axis=2)
    return [Shoved(name, *(int(x) for x in rows[:, k])) for k, name in enumerate(DIRECTIONS)]
