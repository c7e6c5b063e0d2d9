"""`golem bench grasp`: what proposals cost and are, on clouds of tableware and of a bar, as one camera sees them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from golem import registry
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.grasping.base import Grasp, GraspMethod, Gripper
from golem.capabilities.grasping.scorer import Scorer
from golem.errors import ConfigError, GolemError
from golem.evaluation.speed.bench import BenchOutput, Figure, figure, timed
from golem.robots.worlds.tableware import KINDS
from golem.types import Array, Detection, LocalizedObject

EYE: Array = np.array([0.08, 0.0, 0.72])
"""Where the head camera is in base_link, about [m]."""
PLACE: Array = np.array([0.52, -0.20, 0.0])
"""Where the things stand [m]."""
AXIS = 0.015
"""Distance of the closing axis from the thing's own axis within which a grasp is centred [m]."""
REFERENCES = {
    "antipodal": "60 ms wanted, 2000 points",
    "reranked": "150 ms wanted for 64, on top of its proposer",
    "scorer alone": "20 ms wanted",
}


@dataclass(frozen=True)
class GraspBenchConfig(BenchOutput):
    """Time grasp methods on clouds of tableware and of a handle, and count what they propose."""

    methods: tuple[str, ...] = ("centroid", "antipodal", "scorer", "reranked")
    """Which; those that need a server or weights say so."""
    points: int = 2000
    """Points of each cloud."""
    n: int = 10
    """Clouds of each thing."""
    noise: float = 0.002
    """Standard deviation of the points [m]."""


def run_grasp_bench(config: GraspBenchConfig) -> list[Figure]:
    """Measure and print. Raises ConfigError: a number is out of range, or a method does not exist."""
    if config.points < 50 or config.n < 1 or config.seed < 0 or config.noise < 0.0:
        raise ConfigError("--points must be 50 or more, --n 1 or more, --seed and --noise 0 or more.")
    console, figures = Console(), list[Figure]()
    table = Table("method", "thing", "ms, median", "proposals, median", "first is centred", title="Proposals")
    things = [*KINDS, "handle"]
    for use in config.methods:
        method: GraspMethod = registry.create("grasp_method", use, {})
        for thing in things:
            rng = np.random.default_rng(config.seed)
            given = [cloud(thing, config.points, config.noise, rng) for _ in range(config.n)]
            try:
                times, answers = _measure(method, given, _gripper(thing))
            except GolemError as lack:
                console.print(f"{use} left out: {lack}")
                break
            centred = sum(_centred(grasps, thing) for grasps in answers)
            count = float(np.median([len(grasps) for grasps in answers]))
            table.add_row(use, thing, f"{1e3 * np.median(times):.1f}", f"{count:g}", f"{centred}/{config.n}")
            figures.append(figure(f"{use}, {thing}", times, 1e3, "ms", REFERENCES.get(use, "")))
            if isinstance(method, Scorer):
                times = timed(lambda i, m=method, a=answers, g=given: m.scored(g[i], a[i]), len(given))
                table.add_row("scorer alone", thing, f"{1e3 * np.median(times):.1f}", f"{count:g}", "")
                figures.append(figure(f"scorer alone, {thing}", times, 1e3, "ms", REFERENCES["scorer alone"]))
    console.print(table)
    return config.told(figures)


def _measure(
    method: GraspMethod, given: Sequence[LocalizedObject], gripper: Gripper
) -> tuple[Array, list[list[Grasp]]]:
    answers: list[list[Grasp]] = []
    method.propose(given[0], given[0].points, gripper)  # compiles what is compiled

    def propose(i: int) -> None:
        answers.append(method.propose(given[i], given[i].points, gripper))

    return timed(propose, len(given)), answers


def _gripper(thing: str) -> Gripper:
    """Return a right hand that comes ahead for a handle and from above for what stands."""
    ahead = thing == "handle"
    approach = np.array([1.0, 0.0, 0.0] if ahead else [0.0, 0.0, -1.0])
    q = POSTURES["forward" if ahead else "ready"]
    return Gripper("right", np.eye(4), -np.pi / 2, approach, q)


def _centred(grasps: Sequence[Grasp], thing: str) -> bool:
    """Return whether the closing axis of the first grasp passes the thing's own axis, or a bowl's wall."""
    if not grasps:
        return False
    T = grasps[0].T_odom_gripper
    off = (PLACE - T[:3, 3])[:2]
    across = abs(float(off @ T[:2, 1]) / max(float(np.linalg.norm(T[:2, 1])), 1e-6))
    if across < AXIS:
        return True
    # What is open at the top may be taken by its wall.
    open_top = thing in ("bowl", "mug")
    return open_top and abs(float(np.linalg.norm(off)) - KINDS[thing][0]) < AXIS


def cloud(thing: str, count: int, noise: float, rng: np.random.Generator) -> LocalizedObject:
    """Return what one camera sees of a thing at `PLACE` and of the surface behind it.

    Args:
        thing: one of `KINDS`, or `handle`.
        count: points of it.
        noise: their standard deviation [m].
    """
    radius, height = (0.0125, 0.30) if thing == "handle" else KINDS[thing]
    angle, up = rng.uniform(0.0, 2.0 * np.pi, 8 * count), rng.uniform(0.0, 1.0, 8 * count)
    normal = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    wide = radius * (0.5 + 0.5 * np.sqrt(up)) if thing == "bowl" else np.full(len(up), radius)
    side = PLACE + normal * wide[:, None] + np.column_stack([np.zeros((len(up), 2)), height * up])
    seen = side[((EYE - side) * normal).sum(axis=1) > 0.0]
    parts = [seen[: (count if thing == "handle" else int(0.6 * count))]]
    if thing == "handle":
        y, z = rng.uniform(-0.08, 0.08, count // 2), rng.uniform(0.0, height, count // 2)
        parts.append(PLACE + np.column_stack([np.full(len(y), 0.055), y, z]))
    else:
        r, turn = radius * np.sqrt(rng.random(count // 4)), rng.uniform(0.0, 2 * np.pi, count // 4)
        closed = thing in ("can", "bottle")
        ring = radius * rng.uniform(0.92, 1.0, len(r))
        r = r if closed else ring
        parts.append(PLACE + np.column_stack([r * np.cos(turn), r * np.sin(turn), np.full(len(r), height)]))
        ground = rng.uniform(-1.8, 1.8, (count // 2, 2)) * radius
        parts.append(PLACE + np.column_stack([ground, np.zeros(len(ground))]))
    points = np.concatenate(parts)
    points += noise * rng.standard_normal(points.shape)
    position = PLACE + (-radius, 0.0, height / 2)
    box = np.array([300.0, 200.0, 340.0, 280.0])
    return LocalizedObject(Detection(thing, 0.9, box, box[:2] + 20.0), 0.0, position, points)
