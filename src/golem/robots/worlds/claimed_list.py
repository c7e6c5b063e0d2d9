"""The fasteners that a gantry says it found: true places with a detector's errors."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from golem.robots.worlds.layout import KINDS, Kind, PackLayout
from golem.types import Array


@dataclass(frozen=True, slots=True)
class ListErrors:
    """What is wrong with a list: deviation of a place along each axis [m], shares of wrong classes, of fasteners that
    are listed twice, `apart` as in the list of a real pack [m], and of those that are missed."""  # noqa: D205, D209

    place: float = 0.003
    kind: float = 0.05
    double: float = 0.08
    missed: float = 0.0
    apart: tuple[float, float] = (0.008, 0.022)


class Claimed(NamedTuple):
    """One row: the name the cell gives it, such as `Screw_12`, its class, and its place (3,) in the list's frame."""

    name: str
    kind: Kind
    position: Array


def claimed_list(
    layout: PackLayout, T_list_world: Array, errors: ListErrors, rng: np.random.Generator, gone: Collection[int] = ()
) -> list[Claimed]:
    """Return what a gantry would claim of a pack whose places `gone` hold nothing; `T_list_world` is (4, 4)."""
    T, rows = T_list_world @ layout.pose(), list[tuple[Kind, Array]]()
    for slot, spot in enumerate(layout.fasteners()):
        luck, noise = rng.random(5), rng.normal(size=3) * errors.place
        kind: Kind = layout.kind(slot)
        if slot in gone or luck[0] < errors.missed:
            continue
        if luck[1] < errors.kind:
            others: list[Kind] = [other for other in KINDS if other != kind]
            kind = others[int(2 * luck[2])]
        at = (T @ (*spot, 1.0))[:3] + noise
        rows.append((kind, at))
        if luck[3] < errors.double:
            away, turn = errors.apart[0] + np.ptp(errors.apart) * luck[2], 2 * np.pi * luck[4]
            rows.append((kind, at + away * np.array([np.cos(turn), np.sin(turn), 0.0])))
    count, claims = dict.fromkeys(KINDS, 0), list[Claimed]()
    for kind, at in (rows[i] for i in rng.permutation(len(rows))):
        claims.append(Claimed(f"{kind.capitalize()}_{count[kind]}", kind, at))
        count[kind] += 1
    return claims
