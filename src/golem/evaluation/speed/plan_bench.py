"""The planning table of `golem bench arms`: success, CPU time, and trajectories checked again by other means."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from golem.capabilities.arms.trajectory import gate_limits
from golem.capabilities.collision.mesh_oracle import MeshOracle
from golem.capabilities.collision.pack_robot import our_robot
from golem.capabilities.collision.sphere_robot import load_spheres
from golem.capabilities.planning.base import ArmPlanner, Plan, PlanRefused, PlanRequest
from golem.capabilities.planning.hermite import interpolate
from golem.capabilities.planning.joint_space import PlanningRobot
from golem.capabilities.planning.path_planner import fine_points
from golem.capabilities.planning.rrt_connect import RrtConnect
from golem.capabilities.planning.straight import Straight
from golem.evaluation.metrics.statistics import wilson
from golem.evaluation.speed.bench import Figure, figure
from golem.evaluation.speed.plan_queries import Query, queries
from golem.robots.model.table import JOINT_NAMES
from golem.types import UPPER, Array

WITHIN = 1.0
"""CPU time within which a plan counts [s]."""
MESH_STEP = 0.05
"""Distance of the postures of a trajectory that are checked with the meshes [rad in a joint]."""


@dataclass(frozen=True, slots=True)
class PlanScore:
    """How one planner did.

    Attributes:
        solved: queries with a plan within `WITHIN`.
        times: (n,) CPU time of each query [s].
        durations: of the trajectories [s].
        hits: trajectories that leave free space by the collision model, at steps of 0.01 rad.
        mesh_hits: trajectories on which links touch by their meshes.
        beyond: trajectories beyond a limit of position or speed.
    """

    solved: int
    times: Array
    durations: Array
    hits: int
    mesh_hits: int
    beyond: int


def planning_table(n: int, seed: int) -> list[Figure]:
    """Measure and print; return the figures."""
    planners: dict[str, ArmPlanner] = {"rrt_connect": RrtConnect(), "straight": Straight()}
    robot = PlanningRobot()
    asked = list(queries(robot, n, seed))
    table = Table(
        "planner",
        "solved in 1 s",
        "ms: median, p95, p99",
        "motion, s",
        "invalid",
        title=f"Planning, {n} queries at varied packs, CPU time of one thread",
        caption="invalid: trajectories not free at 0.01 rad / with links that touch by their meshes / beyond limits",
    )
    figures: list[Figure] = []
    for name, planner in planners.items():
        score = measure(planner, robot, asked)
        share = wilson(score.solved, n)
        ms = 1e3 * np.quantile(score.times, (0.5, 0.95, 0.99))
        table.add_row(
            name,
            f"{score.solved}/{n} [{100 * share.low:.1f}, {100 * share.high:.1f}] %",
            ", ".join(f"{x:.1f}" for x in ms),
            f"{np.median(score.durations):.2f}" if len(score.durations) else "-",
            f"{score.hits} / {score.mesh_hits} / {score.beyond}",
        )
        figures.append(figure(f"plan, {name}", score.times, 1e3, "ms", "60 ms wanted"))
    Console().print(table)
    return figures


def measure(planner: ArmPlanner, robot: PlanningRobot, asked: list[Query]) -> PlanScore:
    """Put every query to `planner`, and check each answer with what the planner does not use."""
    links = our_robot()[1]
    mesh = MeshOracle(links, load_spheres().pairs)
    planner.plan(replace(asked[0].request))  # compiles, where nothing is cached
    times, durations = np.empty(len(asked)), list[float]()
    solved = hits = mesh_hits = beyond = 0
    columns = _columns(mesh)
    for i, query in enumerate(asked):
        start = time.thread_time()
        try:
            plan = planner.plan(query.request)
        except PlanRefused:
            plan = None
        times[i] = time.thread_time() - start
        if plan is None:
            continue
        solved += times[i] <= WITHIN
        durations.append(float(plan.times[-1]))
        Q = fine_points(plan.times, plan.q, plan.dq)
        model = robot.model(query.request.held)
        hits += bool(model.collides_each(Q, 0.0, query.request.world).any())
        beyond += not within_limits(plan, query.request)
        sparse = Q[_every(Q, MESH_STEP)]
        full = np.zeros((len(sparse), len(columns)))
        full[:, columns >= 0] = sparse[:, columns[columns >= 0]]
        mesh_hits += any(mesh.collides(q) for q in full)
    return PlanScore(solved, times, np.array(durations), hits, mesh_hits, beyond)


def within_limits(plan: Plan, request: PlanRequest) -> bool:
    """Return whether a trajectory begins and ends where it shall, at rest, and keeps the gate's range and speed."""
    lower, upper, fastest = gate_limits()
    dt = 0.002
    Q = interpolate(plan.times, plan.q, plan.dq, np.arange(0.0, plan.times[-1] + dt, dt))
    ends = (
        np.abs(plan.q[0] - request.q).max() < 1e-9
        and min(np.abs(plan.q[-1] - goal).max() for goal in np.atleast_2d(request.goals)) < 1e-9
    )
    inside = bool((Q >= lower - 1e-9).all() and (Q <= upper + 1e-9).all())
    still = float(np.abs(plan.dq[[0, -1]]).max()) < 1e-9
    return bool(ends and inside and still and (np.abs(np.diff(Q, axis=0)) <= dt * fastest + 1e-9).all())


def _every(Q: Array, step: float) -> list[int]:
    """Return the rows of `Q`, each the first that is farther than `step` from the one before, and the last."""
    rows = [0]
    for i in range(1, len(Q)):
        if np.abs(Q[i] - Q[rows[-1]]).max() >= step:
            rows.append(i)
    return [*rows, len(Q) - 1]


def _columns(mesh: MeshOracle) -> NDArray[np.int64]:
    """Return for each joint of the meshes' tree its column among torso and arms, or -1."""
    names = list(JOINT_NAMES[UPPER])
    joints = [link.joint for link in mesh.links if link.kind != "fixed"]
    return np.array([names.index(j) if j in names else -1 for j in joints])
