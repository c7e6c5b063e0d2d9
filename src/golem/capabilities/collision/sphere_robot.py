"""A robot as spheres on its links, with the pairs that may meet; a JSON file of it."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from golem.errors import ConfigError, unknown_name
from golem.robots.model.link_geometry import LinkGeometry
from golem.types import Array

SphereKind = Literal["tight", "conservative"]
SPHERE_KINDS: tuple[SphereKind, ...] = ("tight", "conservative")
FORMAT = "golem-spheres-1"
H12_SPHERES = Path(__file__).with_name("h12_spheres.json")
"""The conservative set of the H1-2 with MAGPIE hands, its fingers open; `golem model spheres` makes it."""


@dataclass(frozen=True, slots=True)
class Packing:
    """Spheres of one link: centres (n, 3) and radii (n,) in its frame [m]."""

    centres: Array
    radii: Array

    def gap(self, points: Array) -> Array:
        """Return g (n,) of points (n, 3) [m]: positive outside every sphere."""
        return np.concatenate(
            [
                (np.linalg.norm(p[:, None] - self.centres, axis=2) - self.radii).min(axis=1)
                for p in np.array_split(points, max(1, len(points) // 4000))
            ]
        )


@dataclass(frozen=True, slots=True)
class SphereRobot:
    """Spheres of a robot.

    Attributes:
        links: the tree, without surfaces, parents before children.
        pairs: (n, 2) indices of the links that are tested against each other.
        allowed: (n,) depth to which spheres of each pair may overlap [m]: they stand out where the links do not touch.
        ignored: (k, 2) indices of spheres, counted over all links, that are not: they overlap where links do not.
    """

    name: str
    kind: SphereKind
    links: tuple[LinkGeometry, ...]
    packings: tuple[Packing, ...]
    pairs: NDArray[np.int64]
    allowed: Array
    ignored: NDArray[np.int64]

    @property
    def count(self) -> int:
        """The number of spheres."""
        return sum(len(p.radii) for p in self.packings)


def save_spheres(robot: SphereRobot, file: Path) -> None:
    """Write the JSON file in metres, to 0.01 mm, radii rounded up. Raises ConfigError: it cannot be written."""
    rows = []
    for link, packing in zip(robot.links, robot.packings, strict=True):
        spheres = np.column_stack([packing.centres.round(5), np.ceil(packing.radii * 1e5 + 1.0) / 1e5])
        rows.append(
            {
                "name": link.name,
                "parent": link.parent,
                "joint": link.joint,
                "kind": link.kind,
                "axis": link.axis.round(12).tolist(),
                "anchor": link.anchor.round(9).tolist(),
                "range": [link.lower, link.upper],
                "T_parent_link": link.T_parent_link[:3].round(12).tolist(),
                "spheres": spheres.round(5).tolist(),
            }
            | ({"follows": [link.leader, link.ratio, link.offset]} if link.leader else {})
        )
    head = {"format": FORMAT, "robot": robot.name, "kind": robot.kind}
    lines = [json.dumps(head)[:-1], ' "links": [\n  ' + ",\n  ".join(json.dumps(row) for row in rows) + "]"]
    lines += [f' "{key}": {json.dumps(getattr(robot, key).tolist())}' for key in ("pairs", "allowed", "ignored")]
    try:
        file.write_text(",\n".join(lines) + "}\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"Cannot write '{file}': {error.strerror}.") from error


def load_spheres(file: Path = H12_SPHERES) -> SphereRobot:
    """Read a file of `save_spheres`. Raises ConfigError: it cannot be read, or is no such file."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
        if data["format"] != FORMAT or data["kind"] not in SPHERE_KINDS:
            raise ValueError(f"format {data['format']}, kind {data['kind']}")
        links: list[LinkGeometry] = []
        packings: list[Packing] = []
        for row in data["links"]:
            T = np.vstack([row["T_parent_link"], [0.0, 0.0, 0.0, 1.0]])
            axis, anchor = np.array(row["axis"]), np.array(row["anchor"])
            lower, upper = row["range"]
            links.append(
                LinkGeometry(
                    row["name"],
                    row["parent"],
                    T,
                    row["joint"],
                    row["kind"],
                    axis,
                    anchor,
                    lower,
                    upper,
                    (),
                    *row.get("follows", ()),
                )  # fmt: skip
            )
            spheres = np.array(row["spheres"], float).reshape(-1, 4)
            packings.append(Packing(spheres[:, :3].copy(), spheres[:, 3].copy()))
        allowed = np.array(data["allowed"], float)
        pairs, ignored = (np.array(data[k], np.int64).reshape(-1, 2) for k in ("pairs", "ignored"))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"Cannot read '{file}' as a file of spheres ({error}); `golem model spheres` writes one."
        ) from error
    return SphereRobot(data["robot"], data["kind"], tuple(links), tuple(packings), pairs, allowed, ignored)


@functools.cache
def shipped_spheres() -> SphereRobot:
    """Return those of the H1-2 with MAGPIE hands, read once; nobody writes to them."""
    return load_spheres()


def holding(robot: SphereRobot, hand: str, held: Packing, name: str = "held") -> SphereRobot:
    """Return the robot with an object in its hand, as a link that moves with it.

    The object is tested against what the hand is tested against, so not against the fingers. Raises ConfigError: no
    such link, or the name is one already.

    Args:
        robot: with empty hands.
        hand: name of the link that holds.
        held: spheres of the object in the frame of that link.
    """
    names = [link.name for link in robot.links]
    if hand not in names:
        raise unknown_name("link", hand, names)
    if name in names:
        raise ConfigError(f"'{name}' is a link of the robot already; give what it holds another name.")
    at, new = names.index(hand), len(names)
    link = LinkGeometry(name, at, np.eye(4), "", "fixed", np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0, 0.0, ())
    partners = [int(b if a == at else a) for a, b in robot.pairs if at in (a, b)]
    return replace(
        robot,
        links=(*robot.links, link),
        packings=(*robot.packings, held),
        pairs=np.concatenate([robot.pairs, np.array([(i, new) for i in partners], np.int64).reshape(-1, 2)]),
        allowed=np.append(robot.allowed, np.zeros(len(partners))),
    )


def sphere_columns(robot: SphereRobot) -> tuple[NDArray[np.int64], Array, Array]:
    """Return (n,) link, (n, 3) centre in the link [m] and (n,) radius [m] of every sphere."""
    link = np.repeat(np.arange(len(robot.links)), [len(p.radii) for p in robot.packings])
    return (
        link,
        np.concatenate([p.centres for p in robot.packings]).reshape(-1, 3),
        np.concatenate([p.radii for p in robot.packings]),
    )
