"""Compiles every kernel ahead: each is called once with what it is called with in a trial, and numba keeps it on disk.

`python -m golem.evaluation.speed.compile_ahead` does it in a process of its own.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np

from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.arms.quick_ik import QuickIK
from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.obstacles import World, cloud_grid
from golem.capabilities.collision.sphere_robot import load_spheres
from golem.capabilities.grasping.centroid import grasp_pose
from golem.capabilities.odometry.plane_map import PlaneMap
from golem.capabilities.planning import plan_kernel
from golem.capabilities.planning.base import PlanRefused
from golem.capabilities.planning.joint_space import PlanningRobot
from golem.capabilities.planning.rrt_connect import RrtConnect
from golem.evaluation.speed.arms_bench import queries
from golem.evaluation.speed.bench import navigation_times
from golem.kernels import stamp_of_all
from golem.runtime.lockstep import build
from golem.stack import load_stack
from golem.types import Array

RUNS = {"hall": 1.5, "stand": 0.1, "fridge-stand": 0.1, "tether": 0.1}
"""Stacks whose 500 Hz chain, LiDAR and odometry run for a moment [s]."""


def compile_kernels() -> None:
    """Compile what is not on disk yet."""
    for name, seconds in RUNS.items():
        running, robot = build(load_stack(name, profile="field"), 0)
        running.executor.run(seconds)
        robot.close()
    navigation_times(_once, 1)
    PlaneMap().insert(np.zeros((6000, 3)), 1.0)  # more than it has room for
    robot, ready = PlanningRobot(), POSTURES["ready"]
    QuickIK().solve("left", grasp_pose(np.array([0.4, 0.2, 0.1]), 1.5), ready[None])
    for query in queries(robot, 4, 0):
        with suppress(PlanRefused):
            RrtConnect().plan(query)
    model, cloud = CollisionModel(load_spheres()), World((), cloud_grid(np.full((4, 3), 0.5)))
    for world in (None, cloud):
        model.collides_each(np.zeros((1, len(model.joints))), 0.0, world)
    model.nearest_world(np.zeros(len(model.joints)), cloud, 4, 1.0)
    cloud.distance(np.zeros((1, 3)), 1.0)


def compile_if_cold() -> float | None:
    """Compile in a process of its own what is older than its source; return the CPU time [s], None: nothing was."""
    kept = Path(str(plan_kernel.verdict.stats.cache_path)) / f"compiled-{sys.version_info[0]}.{sys.version_info[1]}"
    now = stamp_of_all()
    if kept.is_file() and kept.read_text(encoding="utf-8") == now:
        return None
    start = os.times()
    code = subprocess.run([sys.executable, "-P", "-m", __spec__.name], check=False).returncode
    end = os.times()
    if not code:
        kept.write_text(now, encoding="utf-8")
    return end.children_user + end.children_system - start.children_user - start.children_system


def _once(step: Callable[[int], object], n: int) -> Array:
    step(0)
    return np.zeros(n)


if __name__ == "__main__":
    compile_kernels()
