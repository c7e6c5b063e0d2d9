"""Packs a whole robot: `golem model spheres`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from golem.capabilities.collision.link_poses import hold_joints
from golem.capabilities.collision.packing_report import (
    CollisionScore,
    LinkCoverage,
    coverage,
    score_collisions,
)
from golem.capabilities.collision.pair_table import find_pairs, sample_postures
from golem.capabilities.collision.sphere_packer import Packing, SphereKind, pack
from golem.capabilities.collision.sphere_robot import (
    SphereRobot,
    save_spheres,
    without_surfaces,
)
from golem.capabilities.collision.surface import link_surface
from golem.errors import ConfigError
from golem.robots.model.link_geometry import LinkGeometry, h12_geometry, read_geometry
from golem.robots.model.magpie_model import FINGERS, finger_names
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, SIDES

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
    """Pack, print the report and write the file.

    Raises:
        ConfigError: a number is out of range, or the file cannot be read, has no geometry or an open mesh.
    """
    if config.file is None:
        name, links = our_robot()
    else:
        geometry = read_geometry(config.file, config.geometry)
        name, links = geometry.name, geometry.links
    packed = pack_robot(name, links, config)
    _print(packed)
    if config.out is not None:
        save_spheres(packed.robot, config.out)
        print(f"Wrote {config.out}")
    return packed


def pack_robot(name: str, links: tuple[LinkGeometry, ...], config: SpheresConfig) -> PackedRobot:
    """Pack the links of a robot.

    Args:
        name: of the robot.
        links: with surfaces.
        config: how; `file` and `out` are not looked at.

    Raises:
        ConfigError: a number is out of range, or a mesh is open.
    """
    solid = [i for i, link in enumerate(links) if link.parts]
    if config.spheres < LEAST * len(solid):
        raise ConfigError(
            f"--spheres is {config.spheres}; '{name}' has {len(solid)} links with a surface, "
            f"which take {LEAST * len(solid)} or more."
        )
    if not config.tolerance > 0.0 or config.postures < 2:
        raise ConfigError("--tolerance must be positive, and --postures 2 or more.")
    surfaces = {i: link_surface(links[i].name, links[i].parts, config.seed) for i in solid}
    weight = {i: float(len(s.points) * s.step**2) ** SHARE for i, s in surfaces.items()}
    spare = config.spheres - LEAST * len(solid)
    share = {i: LEAST + int(spare * w / sum(weight.values())) for i, w in weight.items()}

    def packed_as(kind: SphereKind) -> tuple[Packing, ...]:
        return tuple(
            pack(surfaces[i], kind, config.tolerance, share[i], config.seed)
            if i in surfaces
            else Packing(np.zeros((0, 3)), np.zeros(0))
            for i in range(len(links))
        )

    packings = packed_as("conservative")
    table = find_pairs(links, packings, sample_postures(links, config.postures, config.seed, config.still))
    allowed, ignored = table.allowed, table.ignored
    if config.kind == "tight":
        packings, ignored = packed_as("tight"), np.zeros((0, 2), np.int64)
        allowed = np.zeros(len(allowed))
    robot = SphereRobot(name, config.kind, without_surfaces(links), packings, table.pairs, allowed, ignored)
    report = [
        coverage(links[i].name, link_surface(links[i].name, links[i].parts, config.seed + 1), packings[i])
        for i in solid
    ]
    judged = sample_postures(links, config.postures, config.seed + 1, config.still)
    return PackedRobot(
        robot, tuple(report), score_collisions(robot, links, table.pairs, judged), table.always
    )


def our_robot() -> tuple[str, tuple[LinkGeometry, ...]]:
    """Return name and links of the H1-2 with MAGPIE hands, whose fingers are open."""
    geometry = h12_geometry()
    hinges = [name for side in SIDES for f in FINGERS for name in finger_names(side, f)[:2]]
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
