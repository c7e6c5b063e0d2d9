"""The fasteners that a gantry says it found: true places with a detector's errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from golem.robots.worlds.layout import KINDS, Kind, PackLayout
from golem.types import Array


@dataclass(frozen=True, slots=True)
class ListErrors:
    """What is wrong with a list; after the one of a real pack (two detections of one nut 8 to 22 mm apart).

    Attributes:
        place: standard deviation of a place along each axis [m].
        kind: share of wrong classes.
        double: share of fasteners that are listed twice, `apart` from each other [m].
        missed: share that is not listed.
    """

    place: float = 0.003
    kind: float = 0.05
    double: float = 0.08
    missed: float = 0.0
    apart: tuple[float, float] = (0.008, 0.022)


@dataclass(frozen=True, slots=True, eq=False)
class Claimed:
    """One row: the `name` the cell gives it, such as `Screw_12`, its class, and its place (3,) in the list's frame."""

    name: str
    kind: Kind
    position: Array


def claimed_list(
    layout: PackLayout, T_list_world: Array, errors: ListErrors, rng: np.random.Generator, gone: Sequence[int] = ()
) -> list[Claimed]:
    """Return what a gantry would claim of a pack.

    Args:
        layout: the truth.
        T_list_world: (4, 4) the world in the frame of the list.
        errors: what is wrong with it.
        rng: the same state makes the same errors.
        gone: places that hold nothing.
    """
    T = T_list_world @ layout.pose()
    rows: list[tuple[Kind, Array]] = []
    for slot, spot in enumerate(layout.fasteners()):
        luck, noise = rng.random(5), rng.normal(size=(2, 3)) * errors.place
        if slot in gone or luck[0] < errors.missed:
            continue
        kind, at = layout.kind(slot), (T @ (*spot, 1.0))[:3]
        if luck[1] < errors.kind:
            kind = [other for other in KINDS if other != kind][int(2 * luck[2])]
        rows.append((kind, at + noise[0]))
        if luck[3] < errors.double:
            low, high = errors.apart
            away, turn = low + (high - low) * luck[2], 2 * np.pi * luck[4]
            rows.append((kind, rows[-1][1] + away * np.array([np.cos(turn), np.sin(turn), 0.0])))
    order = rng.permutation(len(rows))
    count = dict.fromkeys(KINDS, 0)
    claims: list[Claimed] = []
    for kind, at in (rows[i] for i in order):
        claims.append(Claimed(f"{kind.capitalize()}_{count[kind]}", kind, at))
        count[kind] += 1
    return claims
