"""Packs a whole robot: `golem model spheres`.

The pairs of links and spheres that are tested against each other are found by sampling postures. Links that move as one
or share a joint are left out, and so are those that touch in nearly every posture, or come near in none. Near a joint,
as at a shoulder, conservative spheres overlap though their links never touch. So some pairs of spheres are ignored, and
the others may overlap by a depth: whatever sees every sampled contact of the two links, and gives the fewest false
alarms.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from golem.capabilities.collision.sphere_robot import Packing, SphereKind, SphereRobot, save_spheres
from golem.errors import ConfigError
from golem.evaluation.spheres import link_poses
from golem.evaluation.spheres.link_poses import hold_joints, neighbours
from golem.evaluation.spheres.mesh_file import package_folders
from golem.evaluation.spheres.packing_report import CollisionScore, LinkCoverage, coverage, score_collisions
from golem.evaluation.spheres.robot_geometry import h12_geometry, read_geometry
from golem.evaluation.spheres.sphere_packer import pack
from golem.evaluation.spheres.surface import link_surface, open_edges
from golem.robots.model.link_geometry import LinkGeometry, free_links, joint_names
from golem.robots.model.magpie_model import FINGERS, finger_names
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, SIDES, Array

T = TypeVar("T")
ALWAYS = 0.9
"""Share of the postures in which links touch that count as always touching."""
NEAR = 0.15
"""Links whose spheres come no nearer in any posture are never tested [m]; samples of two hands seldom meet."""
SHARES = (1.0, 0.5, 0.3, 0.1, 0.03)
"""Spheres that overlap in more than such a share of the postures, links apart, are ignored: these are tried."""
ALARMS = 0.01
"""Share of postures in which the spheres of two links may raise a false alarm, so that nothing is done about it."""
CONTACTS = 200
"""Sampled contacts of two links from which on their spheres are allowed to overlap."""
SAFETY = 0.001
"""How much less they may overlap than in the shallowest contact [m]."""
ZERO_SPREAD = 0.35
"""Standard deviation of the half of the postures that lie around zero [rad]."""


def sample_postures(links: Sequence[LinkGeometry], n: int, seed: int, still: Sequence[str] = ()) -> Array:
    """Return (n, joints) postures: half around zero, the others anywhere in the ranges; `still` are joints at zero."""
    rng = np.random.default_rng(seed)
    moving = free_links(links)
    lower, upper = np.array([link.lower for link in moving]), np.array([link.upper for link in moving])
    around = np.clip(ZERO_SPREAD * rng.standard_normal((n // 2, len(moving))), lower, upper)
    postures = np.concatenate([around, rng.uniform(lower, upper, (n - n // 2, len(moving)))])
    postures[:, [link.joint in still for link in moving]] = 0.0
    return postures


@dataclass(frozen=True, slots=True)
class PairTable:
    """See `SphereRobot` for `pairs`, `allowed` and `ignored`; `always` names links that always touch."""

    pairs: NDArray[np.int64]
    allowed: Array
    ignored: NDArray[np.int64]
    always: tuple[tuple[str, str], ...]


def find_pairs(links: Sequence[LinkGeometry], packings: Sequence[Packing], postures: Array) -> PairTable:
    """Return what is tested.

    Args:
        links: with surfaces.
        packings: conservative spheres of each link.
        postures: (n, joints) samples.
    """
    apart = neighbours(links)
    solid = [i for i, link in enumerate(links) if link.parts]
    every: NDArray[np.int64] = np.array([p for p in combinations(solid, 2) if p not in apart], np.int64)
    every = every.reshape(-1, 2)
    assert postures.shape[1] == len(joint_names(links))
    poses = np.array([link_poses.link_poses(links, q) for q in postures])
    oracle = link_poses.MeshOracle(links, every)
    touching = np.array([oracle.touching(q) for q in _bar("postures", postures)])
    first = np.cumsum([0, *(len(p.radii) for p in packings)])
    centres = [
        np.einsum("nij,kj->nki", poses[:, i, :3, :3], p.centres) + poses[:, i, None, :3, 3]
        for i, p in enumerate(packings)
    ]
    kept: list[tuple[int, int]] = []
    ignored = [np.zeros((0, 2), np.int64)]
    allowed: list[float] = []
    always: list[tuple[str, str]] = []
    for (a, b), touch in zip(every, touching.T, strict=True):
        if touch.mean() > ALWAYS:
            always.append((links[a].name, links[b].name))
            continue
        gaps = _gaps(centres[a], centres[b], packings[a].radii[:, None] + packings[b].radii)
        if gaps.min() > NEAR:
            continue
        bad, depth = _tuned(gaps, touch)
        kept.append((int(a), int(b)))
        allowed.append(depth)
        ignored.append(np.argwhere(bad) + np.array([first[a], first[b]], np.int64))
    return PairTable(np.array(kept, np.int64).reshape(-1, 2), np.array(allowed), np.concatenate(ignored), tuple(always))


def _tuned(gaps: NDArray[np.float32], touch: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], float]:
    """Return which spheres (k, l) to ignore and how deep the others may overlap, given gaps (n, k, l) and contacts."""
    share = (gaps[~touch] <= 0.0).mean(axis=0) if not touch.all() else np.zeros(gaps.shape[1:])
    best = np.zeros(share.shape, bool), 0.0
    best_alarms = float((gaps[~touch] <= 0.0).any(axis=(1, 2)).sum())
    if best_alarms <= ALARMS * len(gaps):
        return best
    for limit in SHARES:
        bad = share > limit
        if bad.all():
            break
        nearest = np.where(bad, np.inf, gaps).min(axis=(1, 2))
        shallowest = float(nearest[touch].max()) if touch.any() else 0.0
        if shallowest > 0.0:
            break
        depth = max(0.0, -shallowest - SAFETY) if touch.sum() >= CONTACTS else 0.0
        alarms = float((nearest[~touch] <= -depth).sum())
        if alarms < best_alarms:
            best, best_alarms = (bad, round(depth, 5)), alarms
    return best


def _gaps(a: Array, b: Array, reach: Array) -> NDArray[np.float32]:
    """Return (n, k, l) distances between the surfaces of (n, k) and (n, l) spheres [m]."""
    out = np.empty((len(a), a.shape[1], b.shape[1]), np.float32)
    for i in range(len(a)):
        out[i] = np.linalg.norm(a[i][:, None] - b[i], axis=2) - reach
    return out


SHARE = 0.75
"""Spheres of a link go with its area to this power: small links are those that go near others."""
LEAST = 2
"""Spheres of the smallest link."""


@dataclass(frozen=True)
class SpheresConfig:
    """Cover the links of a robot with spheres, and report what they miss."""

    file: tyro.conf.Positional[Path | None] = None
    """URDF or MJCF file; without it, the H1-2 with MAGPIE hands."""
    out: Path | None = None
    """JSON file to write."""
    kind: Literal["tight", "conservative"] = "conservative"
    """tight: near the surface on both sides; conservative: around all of it."""
    spheres: int = 600
    """How many, at most, over all links."""
    tolerance: float = 0.006
    """A sphere need not stand out less [m]."""
    geometry: Literal["visual", "collision"] = "visual"
    """Which surfaces of a link count."""
    package: tuple[str, ...] = ()
    """Folders of ROS packages as NAME=FOLDER; others are looked for above the file and in the paths of ROS."""
    postures: int = 3000
    """Postures that find the pairs, and as many others that judge them."""
    still: tuple[str, ...] = JOINT_NAMES[LEGS]
    """Joints that stay at zero in the postures: by default, the legs of the H1-2."""
    seed: int = 0
    """Of all samples."""


@dataclass(frozen=True, slots=True)
class PackedRobot:
    """Spheres of a robot with their report; `always` names pairs of links that always touch."""

    robot: SphereRobot
    coverage: tuple[LinkCoverage, ...]
    score: CollisionScore
    always: tuple[tuple[str, str], ...]


def run_spheres(config: SpheresConfig) -> PackedRobot:
    """Pack, print the report and write the file. Raises ConfigError: a wrong number, or a file without geometry."""
    if config.file is None:
        name, links = our_robot()
    else:
        geometry = read_geometry(config.file, config.geometry, package_folders(config.package))
        name, links = geometry.name, geometry.links
        _tell(links)
    packed = pack_robot(name, links, config)
    _print(packed)
    if config.out is not None:
        save_spheres(packed.robot, config.out)
        print(f"Wrote {config.out}")
    return packed


def pack_robot(name: str, links: tuple[LinkGeometry, ...], config: SpheresConfig) -> PackedRobot:
    """Pack the links of a robot. Raises ConfigError: a number is out of range, or a mesh is not finite.

    Args:
        links: with surfaces.
        config: how; `file` and `out` are not looked at.
    """
    solid = [i for i, link in enumerate(links) if link.parts]
    if config.spheres < LEAST * len(solid):
        raise ConfigError(
            f"--spheres is {config.spheres}; '{name}' has {len(solid)} links with a surface, "
            f"which take {LEAST * len(solid)} or more."
        )
    if not config.tolerance > 0.0 or config.postures < 2:
        raise ConfigError("--tolerance must be positive, and --postures 2 or more.")
    surfaces = {i: link_surface(links[i].name, links[i].parts, config.seed) for i in _bar("surfaces", solid)}
    weight = {i: float(len(s.points) * s.step**2) ** SHARE for i, s in surfaces.items()}
    spare = config.spheres - LEAST * len(solid)
    share = {i: LEAST + int(spare * w / sum(weight.values())) for i, w in weight.items()}

    def packed_as(kind: SphereKind) -> tuple[Packing, ...]:
        return tuple(
            pack(surfaces[i], kind, config.tolerance, share[i], config.seed)
            if i in surfaces
            else Packing(np.zeros((0, 3)), np.zeros(0))
            for i in _bar("spheres", range(len(links)))
        )

    packings = packed_as("conservative")
    table = find_pairs(links, packings, sample_postures(links, config.postures, config.seed, config.still))
    allowed, ignored = table.allowed, table.ignored
    if config.kind == "tight":
        packings, ignored = packed_as("tight"), np.zeros((0, 2), np.int64)
        allowed = np.zeros(len(allowed))
    tree = tuple(replace(link, parts=()) for link in links)
    robot = SphereRobot(name, config.kind, tree, packings, table.pairs, allowed, ignored)
    report = [
        coverage(links[i].name, link_surface(links[i].name, links[i].parts, config.seed + 1), packings[i])
        for i in solid
    ]
    judged = sample_postures(links, config.postures, config.seed + 1, config.still)
    return PackedRobot(robot, tuple(report), score_collisions(robot, links, table.pairs, judged), table.always)


def _bar(what: str, things: Collection[T]) -> Iterable[T]:
    """Return things that show on a terminal how many are done."""
    return tqdm(things, desc=what, disable=None, leave=False)


def _tell(links: Sequence[LinkGeometry]) -> None:
    rows = {
        "No surface": [link.name for link in links if not link.parts],
        "Held, its limits are equal": [x.joint for x in links if x.kind != "fixed" and x.lower == x.upper],
        "Follows": [f"{link.joint} ({link.leader})" for link in links if link.leader],
        "Holes closed": [
            f"{link.name} ({count} edges)"
            for link in _bar("holes", links)
            if (count := sum(open_edges(part.vertices, part.faces) for part in link.parts))
        ],
    }
    for what, names in rows.items():
        if names:
            print(f"{what}: {', '.join(names)}.")


def our_robot() -> tuple[str, tuple[LinkGeometry, ...]]:
    """Return name and links of the H1-2 with MAGPIE hands, whose fingers are open."""
    geometry = h12_geometry()
    hinges = [finger_names(side, f)[0] for side in SIDES for f in FINGERS]  # the blades follow their cranks
    return geometry.name, hold_joints(geometry.links, dict.fromkeys(hinges, 0.0))


def _print(packed: PackedRobot) -> None:
    robot, score = packed.robot, packed.score
    table = Table("link", "spheres", "covered", "largest gap, mm", "stands out, mm", "volume ratio")
    for row in packed.coverage:
        table.add_row(
            row.link,
            str(row.spheres),
            f"{100 * row.covered:.2f} %",
            f"{1e3 * row.gap:.2f}",
            f"{1e3 * row.stands_out:.1f}",
            f"{row.volume_ratio:.2f}",
        )
    console = Console()
    console.print(table)
    console.print(
        f"{robot.name}, {robot.kind}: {robot.count} spheres, {len(robot.pairs)} pairs of links, "
        f"{len(robot.ignored)} pairs of spheres ignored."
    )
    for one, other in packed.always:
        console.print(f"Always touching, not tested: {one} and {other}.")
    console.print(
        f"Against the meshes, {score.postures} postures: {score.missed} of {score.colliding} collisions missed, "
        f"{score.false_alarms} false alarms ({100 * score.false_share:.1f} % of the free postures)."
    )
