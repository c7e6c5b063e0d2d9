"""`golem bench arms`: collision checks and plans, in CPU time of this thread; plans are checked by other means."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.goal_postures import GoalPostures
from golem.capabilities.arms.postures import downward, posture
from golem.capabilities.arms.trajectory import gate_limits, interpolate
from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.obstacles import Obstacle, World
from golem.capabilities.collision.sphere_robot import load_spheres
from golem.capabilities.planning.base import ArmPlanner, Held, Plan, PlanRefused, PlanRequest
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.capabilities.planning.path_planner import fine_points
from golem.capabilities.planning.rrt_connect import RrtConnect, Straight
from golem.capabilities.planning.rules import HandUpright, Rule
from golem.errors import ConfigError
from golem.evaluation.metrics.statistics import wilson
from golem.evaluation.speed.bench import BenchOutput, Figure, figure, print_figures, timed
from golem.evaluation.spheres.link_poses import MeshOracle
from golem.evaluation.spheres.pack_robot import our_robot
from golem.robots.model.link_geometry import joint_names
from golem.robots.model.table import JOINT_NAMES
from golem.robots.worlds.conditions import arranged, draw_conditions
from golem.robots.worlds.layout import PackLayout
from golem.skills.planned_motion import SCREW
from golem.types import UPPER, Array, Side

PELVIS = 1.10
"""Height of base_link above the floor in the hoist [m]."""
YAW: dict[Side, float] = {"left": 0.5 * np.pi, "right": -0.5 * np.pi}
"""Heading of the gripper's x axis that suits an arm [rad]."""
UPRIGHT = np.deg2rad(45.0)
"""How far a hand that carries a screw may lean in a third of the queries [rad]."""


def queries(robot: PlanningRobot, n: int, seed: int) -> Iterator[PlanRequest]:
    """Yield `n` queries whose start is free and that have a free goal posture; what else is drawn is left out."""
    finder, rng, count = GoalPostures(), np.random.default_rng(seed), 0
    while count < n:
        layout = arranged(PackLayout(), draw_conditions("varied", {}, rng))
        world = pack_world(layout, rng)
        side: Side = "left" if rng.random() < 0.5 else "right"
        places = {"screw": _above_screw(layout, side, rng), "tray": _above_tray(layout, side, rng)}
        kind = ("home to screw", "screw to tray", "tray to screw", "screw to home")[count % 4]
        one, other = kind.split(" to ")
        carries = kind == "screw to tray"
        held = (Held(side, SCREW),) if carries else ()
        rules: tuple[Rule, ...] = (HandUpright(side, UPRIGHT),) if carries and count % 3 == 0 else ()
        ends: list[Array] = []
        for name in (one, other):
            q = posture("home")
            space = JointSpace(robot, q, world, rules, held)
            if name == "home":
                found = q[None][[space.verdict(q) == 0]]
            else:
                T = (places[name], None) if side == "left" else (None, places[name])
                found = finder.find(*T, q, lambda a, s=space: s.verdict(a) == 0, seed=count)
            if not len(found):
                break
            ends.append(found[:1] if name == one else found)
        if len(ends) == 2:
            count += 1
            yield PlanRequest(ends[0][0], ends[1], world, rules, held, seed=count)


def pack_world(layout: PackLayout, rng: np.random.Generator) -> World:
    """Return pack, tray and what stands about as shapes in base_link.

    The cover counts as closed. Up to six boxes lie on it, and in half of the draws a post of 25 cm stands there.
    """
    top = layout.pose()
    shapes = [_box(top, (0.5 * layout.size_x, 0.0, -0.5 * layout.thickness),
                   (0.5 * layout.size_x, 0.5 * layout.size_y, 0.5 * layout.thickness), "pack")]  # fmt: skip
    x, y, z = (0.5 * s for s in layout.tray_size)
    wall, tray = 0.002, layout.tray_pose()
    shapes.append(_box(tray, (0.0, 0.0, wall), (x, y, wall), "tray"))
    for dx, dy, sx, sy in ((x, 0, wall, y), (-x, 0, wall, y), (0, y, x, wall), (0, -y, x, wall)):
        shapes.append(_box(tray, (dx, dy, z), (sx, sy, z), "tray"))
    for k in range(int(rng.integers(7)) + 1):
        tall = k == 0 and rng.random() < 0.5
        half = (0.03, 0.03, 0.125) if tall else tuple(rng.uniform(0.01, 0.04, 3).tolist())
        at = (float(rng.uniform(0.10, 0.5)), float(rng.uniform(-0.5, 0.5)), half[2])
        shapes.append(_box(top, at, half, "post" if tall else "clutter"))
    return World(shapes)


def _box(T_world: Array, at: tuple[float, ...], half: tuple[float, ...], name: str) -> Obstacle:
    T = T_world.copy()
    T[:3, 3] = (T_world @ (*at, 1.0))[:3]
    T[2, 3] -= PELVIS
    return Obstacle("box", T, tuple(float(h) for h in half), name)


def _above_screw(layout: PackLayout, side: Side, rng: np.random.Generator) -> Array:
    slots = layout.reachable()
    spot = layout.fasteners()[slots[int(rng.integers(len(slots)))]]
    x, y, z, _ = layout.pose() @ (*spot, 1.0)
    return downward(float(x), float(y), float(z) - PELVIS + float(rng.uniform(0.04, 0.16)), YAW[side])


def _above_tray(layout: PackLayout, side: Side, rng: np.random.Generator) -> Array:
    x, y, z, _ = layout.tray_pose() @ (*rng.uniform(-0.04, 0.04, 2), 0.0, 1.0)
    return downward(float(x), float(y), float(z) - PELVIS + 0.10, YAW[side])


WITHIN = 1.0
"""CPU time within which a plan counts [s]."""
MESH_STEP = 0.05
"""Distance of the postures of a trajectory that are checked with the meshes [rad in a joint]."""


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
        row, times = measure(planner, robot, asked)
        table.add_row(name, *row)
        figures.append(figure(f"plan, {name}", times, 1e3, "ms", "60 ms wanted"))
    Console().print(table)
    return figures


def measure(planner: ArmPlanner, robot: PlanningRobot, asked: list[PlanRequest]) -> tuple[list[str], Array]:
    """Put every query to `planner`, and check each answer with what the planner does not use.

    Returns:
        row: of the table, without the planner's name.
        times: (n,) CPU time of each query [s].
    """
    links = our_robot()[1]
    mesh = MeshOracle(links, load_spheres().pairs)
    planner.plan(replace(asked[0]))  # compiles, where nothing is cached
    times, durations = np.empty(len(asked)), list[float]()
    solved = hits = mesh_hits = beyond = 0
    for i, query in enumerate(asked):
        start = time.thread_time()
        try:
            plan = planner.plan(query)
        except PlanRefused:
            plan = None
        times[i] = time.thread_time() - start
        if plan is None:
            continue
        solved += times[i] <= WITHIN
        durations.append(float(plan.times[-1]))
        Q = fine_points(plan.times, plan.q, plan.dq)
        model = robot.model(query.held)
        hits += bool(model.collides_each(Q, 0.0, query.world).any())
        beyond += not within_limits(plan, query)
        sparse = Q[_every(Q, MESH_STEP)]
        mesh_hits += any(mesh.collides(whole_posture(mesh, q)) for q in sparse)
    share, ms = wilson(solved, len(asked)), 1e3 * np.quantile(times, (0.5, 0.95, 0.99))
    return [
        f"{solved}/{len(asked)} [{100 * share.low:.1f}, {100 * share.high:.1f}] %",
        ", ".join(f"{x:.1f}" for x in ms),
        f"{np.median(durations):.2f}" if durations else "-",
        f"{hits} / {mesh_hits} / {beyond}",
    ], times


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


def whole_posture(mesh: MeshOracle, q: Array) -> Array:
    """Return the position of each joint of the meshes' tree: torso and arms at `q` (15,), the others at 0 [rad]."""
    known = dict(zip(JOINT_NAMES[UPPER], q, strict=True))
    return np.array([known.get(joint, 0.0) for joint in joint_names(mesh.links)])


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
    """Measure and print. Raises ConfigError: a number is out of range."""
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
