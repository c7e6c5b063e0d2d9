"""`golem bench arms`: collision checks, ticks of inverse kinematics and plans, in CPU time of this thread."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from rich.console import Console

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.diff_ik import DiffIK
from golem.capabilities.arms.postures import posture
from golem.capabilities.arms.task_space import TaskSpaceConfig
from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.link_poses import body_of, joint_names, link_poses
from golem.capabilities.collision.mesh_oracle import link_tree
from golem.capabilities.collision.pack_robot import our_robot
from golem.capabilities.collision.sphere_robot import SphereRobot, load_spheres
from golem.errors import ConfigError, MissingExtra
from golem.evaluation.speed.bench import Figure, figure, ik_figure, print_figures, timed
from golem.evaluation.speed.plan_bench import planning_table
from golem.robots.model.table import JOINT_NAMES
from golem.types import UPPER, Array

NEAR = 0.02
"""Distance between spheres, either way, that makes a posture a near contact [m]."""


@dataclass(frozen=True)
class ArmsBenchConfig:
    """Time collision checks, inverse kinematics and plans, and count what spheres and planner get wrong."""

    postures: int = 10000
    """Postures of torso and arms: a third around `ready`, a third anywhere, a third of them near contact."""
    ticks: int = 4000
    """Ticks of inverse kinematics."""
    plans: int = 500
    """Planning queries; 0 leaves the planning table out."""
    seed: int = 0
    """Of the postures and the queries."""
    json: bool = False
    """Print the figures as a last line of JSON."""


def run_arms_bench(config: ArmsBenchConfig) -> list[Figure]:
    """Measure and print.

    Raises:
        ConfigError: a number is out of range.
    """
    if config.postures < 9 or config.ticks < 1 or min(config.seed, config.plans) < 0:
        raise ConfigError("--postures must be 9 or more, --ticks 1 or more, --plans and --seed 0 or more.")
    robot = load_spheres()
    model = CollisionModel(robot, JOINT_NAMES[UPPER])
    Q = bench_postures(model, config.postures, config.seed)
    mesh, balls = _CoalRobot(robot, meshes=True), _CoalRobot(robot, meshes=False)
    truth = np.zeros(len(Q), bool)

    def ask(check: Callable[[Array], bool], into: NDArray[np.bool_]) -> Callable[[int], None]:
        def step(i: int) -> None:
            into[i] = check(Q[i])

        step(0)
        return step

    found, slow = np.zeros(len(Q), bool), np.zeros(len(Q), bool)
    mesh_times = timed(ask(mesh.collides, truth), len(Q))
    ball_times = timed(ask(balls.collides, slow), min(len(Q), 1000))
    single = timed(ask(model.collides, found), len(Q))
    model.collides_each(Q[:1])
    each = timed(lambda _: model.collides_each(Q), 5) / len(Q)
    near = timed(lambda i: model.nearest(Q[i], 6, 0.1), min(len(Q), 2000))
    figures = [
        figure("collision, coal, meshes", mesh_times, 1e6, "us", "50 us: prototype, the vendor's meshes"),
        figure("collision, coal, our spheres", ball_times, 1e6, "us", "19 us: prototype, 40 spheres"),
        figure("collision, our kernel, single", single, 1e6, "us", "3 us wanted"),
        figure("collision, our kernel, batch", each, 1e6, "us", "0.5 us wanted"),
        figure("six nearest pairs and their gradients", near, 1e6, "us", ""),
    ]
    for name, options in (
        ("diff_ik", TaskSpaceConfig(collision_rows=0)),
        ("diff_ik, 6 rows", TaskSpaceConfig(collision_rows=6)),
    ):
        wanted = "300 us wanted" if options.collision_rows else "70 us wanted"
        figures.append(ik_figure(f"IK tick, {name}", DiffIK(options), config.ticks, wanted))
    try:
        from golem.capabilities.arms.pink_ik import PinkIK

        figures.append(ik_figure("IK tick, pink_ik", PinkIK(), config.ticks, "137 us: prototype of Pink + daqp"))
    except MissingExtra as error:
        Console().print(f"pink_ik left out: {error}")
    missed, false = int((truth & ~found).sum()), int((found & ~truth).sum())
    print_figures(figures)
    console = Console()
    ratio = mesh_times.mean() / single.mean(), mesh_times.mean() / each.mean()
    console.print(
        f"{robot.count} spheres; means: {ratio[0]:.0f} times faster than meshes single, {ratio[1]:.0f} in a batch.\n"
        f"{len(Q)} postures, {int(truth.sum())} collide by the meshes: {missed} missed, {false} false alarms "
        f"({100 * false / max(1, int((~truth).sum())):.1f} % of the free ones)."
    )
    if config.plans:
        figures += planning_table(config.plans, config.seed)
    if config.json:
        print(json.dumps([asdict(f) for f in figures]))
    return figures


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


class _CoalRobot:
    """The same links and pairs through Pinocchio and coal."""

    def __init__(self, robot: SphereRobot, meshes: bool) -> None:
        kinematics = UpperKinematics()
        self._model, data = kinematics.model, kinematics.data
        pin.forwardKinematics(self._model, data, pin.neutral(self._model))
        solid = our_robot()[1]
        poses = link_poses(robot.links, np.zeros(len(joint_names(robot.links))))
        body = body_of(robot.links)
        self._geometry = pin.GeometryModel()
        objects: list[list[int]] = []
        for i, link in enumerate(solid):
            j = body[i]
            while robot.links[j].joint not in JOINT_NAMES[UPPER] and robot.links[j].parent >= 0:
                j = body[robot.links[j].parent]
            joint = self._model.getJointId(robot.links[j].joint) if robot.links[j].joint in JOINT_NAMES[UPPER] else 0
            T = data.oMi[joint].inverse() * pin.SE3(poses[i])
            shapes = [(pin.SE3.Identity(), link_tree(link))] if meshes and link.parts else []
            if not meshes:
                p = robot.packings[i]
                shapes = [
                    (pin.SE3(np.eye(3), c), coal.Sphere(float(r))) for c, r in zip(p.centres, p.radii, strict=True)
                ]
            objects.append(
                [
                    self._geometry.addGeometryObject(pin.GeometryObject(f"{i}.{k}", joint, 0, T * placed, shape))
                    for k, (placed, shape) in enumerate(shapes)
                ]
            )
        first = np.cumsum([0, *(len(p.radii) for p in robot.packings)])
        ignored = {frozenset(pair) for pair in robot.ignored.tolist()}
        for a, b in robot.pairs:
            for k, one in enumerate(objects[a]):
                for m, other in enumerate(objects[b]):
                    alike = self._geometry.geometryObjects[one].parentJoint == (
                        self._geometry.geometryObjects[other].parentJoint
                    )
                    skipped = not meshes and frozenset((int(first[a]) + k, int(first[b]) + m)) in ignored
                    if not alike and not skipped:
                        self._geometry.addCollisionPair(pin.CollisionPair(one, other))
        self._data, self._collisions = data, pin.GeometryData(self._geometry)

    def collides(self, q: Array) -> bool:
        return bool(pin.computeCollisions(self._model, self._data, self._geometry, self._collisions, q, True))
