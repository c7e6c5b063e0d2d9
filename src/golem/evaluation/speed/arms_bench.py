"""`golem bench arms`: collision checks and plans, in CPU time of this thread."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.postures import posture
from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.mesh_oracle import MeshOracle
from golem.capabilities.collision.pack_robot import our_robot
from golem.capabilities.collision.sphere_robot import load_spheres
from golem.errors import ConfigError
from golem.evaluation.speed.bench import BenchOutput, Figure, figure, print_figures, timed
from golem.evaluation.speed.plan_bench import planning_table, whole_posture
from golem.robots.model.table import JOINT_NAMES
from golem.types import UPPER, Array

NEAR = 0.02
"""Distance between spheres, either way, that makes a posture a near contact [m]."""


@dataclass(frozen=True)
class ArmsBenchConfig(BenchOutput):
    """Time collision checks and plans, and count what spheres and planner get wrong."""

    postures: int = 10000
    """Postures of torso and arms: a third around `ready`, a third anywhere, a third of them near contact."""
    plans: int = 500
    """Planning queries; 0 leaves the planning table out."""


def run_arms_bench(config: ArmsBenchConfig) -> list[Figure]:
    """Measure and print.

    Raises:
        ConfigError: a number is out of range.
    """
    if config.postures < 9 or min(config.seed, config.plans) < 0:
        raise ConfigError("--postures must be 9 or more, --plans and --seed 0 or more.")
    robot = load_spheres()
    model = CollisionModel(robot, JOINT_NAMES[UPPER])
    Q = bench_postures(model, config.postures, config.seed)
    mesh = MeshOracle(our_robot()[1], robot.pairs)
    truth, found = np.zeros(len(Q), bool), np.zeros(len(Q), bool)
    postures = [whole_posture(mesh, q) for q in Q]

    def ask(check: Callable[[Array], bool], of: Sequence[Array], into: NDArray[np.bool_]) -> Callable[[int], None]:
        def step(i: int) -> None:
            into[i] = check(of[i])

        step(0)
        return step

    mesh_times = timed(ask(mesh.collides, postures, truth), len(Q))
    single = timed(ask(model.collides, list(Q), found), len(Q))
    model.collides_each(Q[:1])
    each = timed(lambda _: model.collides_each(Q), 5) / len(Q)
    near = timed(lambda i: model.nearest(Q[i], 6, 0.1), min(len(Q), 2000))
    figures = [
        figure("collision, coal, meshes", mesh_times, 1e6, "us", "50 us: prototype, the vendor's meshes"),
        figure("collision, our kernel, single", single, 1e6, "us", "3 us wanted"),
        figure("collision, our kernel, batch", each, 1e6, "us", "0.5 us wanted"),
        figure("six nearest pairs and their gradients", near, 1e6, "us", ""),
    ]
    missed, false = int((truth & ~found).sum()), int((found & ~truth).sum())
    print_figures(figures)
    Console().print(
        f"{robot.count} spheres; {len(Q)} postures, {int(truth.sum())} collide by the meshes: {missed} missed, "
        f"{false} false alarms ({100 * false / max(1, int((~truth).sum())):.1f} % of the free ones)."
    )
    if config.plans:
        figures += planning_table(config.plans, config.seed)
    return config.told(figures)


def bench_postures(model: CollisionModel, n: int, seed: int) -> Array:
    """Return (n, 15): a third around `ready`, a third anywhere in the range, a third of either near contact."""
    rng = np.random.default_rng(seed)
    kinematics = UpperKinematics()
    lower, upper = kinematics.lower, kinematics.upper

    def around(k: int) -> Array:
        return np.clip(posture("ready") + 0.35 * rng.standard_normal((k, len(lower))), lower, upper)

    third, close = n // 3, np.zeros((0, len(lower)))
    rows = [around(third), rng.uniform(lower, upper, (third, len(lower)))]
    while len(close) < n - 2 * third:
        drawn = np.concatenate([around(200), rng.uniform(lower, upper, (200, len(lower)))])
        distance = [(*model.nearest(q, 1, NEAR).distance, NEAR)[0] for q in drawn]
        close = np.concatenate([close, drawn[np.abs(distance) < NEAR]])
    return np.concatenate([*rows, close[: n - 2 * third]])
