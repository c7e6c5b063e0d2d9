"""Whether what a pick says of screws and work place is so."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from golem.capabilities.arms.reach_map import load_map
from golem.skills.pick_config import PickOutcome, PickReport, Sight, Tried
from golem.types import SIDES, Array

SEEN = 0.045
"""A screw this near to the hand that looks at one is that one [m]: half of their pitch."""
LOOKED = 0.08
"""The same for the head camera, which is off by 5 cm and more in the profile `field` [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Fastener:
    """One that was in its place when the pick began.

    Attributes:
        position: (3,) of its bore's mouth in odom [m].
        in_base: (3,) the same in base_link [m].
        loose: whether it was loosened.
        slot: its place in the layout.
    """

    position: Array
    in_base: Array
    loose: bool
    slot: int = -1


REFUSALS = (
    PickOutcome.OUT_OF_REACH,
    PickOutcome.BLOCKED,
    PickOutcome.NOTHING_THERE,
    PickOutcome.TRAY_MISSING,
    PickOutcome.TRAY_FULL,
    PickOutcome.TRAY_OUT_OF_REACH,
    PickOutcome.TIGHT,
    PickOutcome.JAMMED,
)
"""Outcomes that say of the work place that it cannot be done."""


def claims(
    report: PickReport, fasteners: Sequence[Fastener], taken: set[int], in_tray: bool, looked_at: Mapping[int, Array]
) -> dict[str, float]:
    """Return for each outcome that was claimed, as `claim_NAME`, which share of its claims is right.

    `blocked`, `failed` and `slipped` claim nothing that is judged here.

    Args:
        report: what the pick says.
        fasteners: the truth at the beginning.
        taken: which of them are out of their bores at the end.
        in_tray: whether a screw is in the tray at the end.
        looked_at: where what a hand looked at last really was, (3,) in odom [m], by its place in the report; an object
            that none came to has none.
    """
    judged: dict[str, list[float]] = defaultdict(list)
    if not report.tried:
        right = _whole(report.outcome, fasteners)
        if right is not None:
            judged[report.outcome].append(float(right))
    for i, tried in enumerate(report.tried):
        right = _one(tried, fasteners, in_tray, looked_at.get(i))
        if right is not None:
            judged[tried.outcome].append(float(right))
    for name, said, true in (
        ("in_tray", report.in_tray, in_tray),
        ("bore_empty", report.bore_empty, _emptied(fasteners, taken, looked_at.get(len(report.tried) - 1))),
    ):
        if said != Sight.UNKNOWN:
            judged[name].append(float((said == Sight.YES) == true))
    return {f"claim_{name}": float(np.mean(values)) for name, values in judged.items()}


def _emptied(fasteners: Sequence[Fastener], taken: set[int], place: Array | None) -> bool:
    near = None if place is None else _nearest(place, fasteners, SEEN)
    return near is not None and fasteners.index(near) in taken


def _whole(outcome: str, fasteners: Sequence[Fastener]) -> bool | None:
    """Return whether a claim about the whole work place, which has a tray, is right."""
    if outcome == PickOutcome.TRAY_MISSING:
        return False
    if outcome == PickOutcome.NOTHING_THERE:
        return not fasteners
    if outcome == PickOutcome.OUT_OF_REACH:
        served = (load_map().serves(side, f.in_base) for f in fasteners if f.loose for side in SIDES)
        return not any(served)
    return None


def _one(tried: Tried, fasteners: Sequence[Fastener], in_tray: bool, looked: Array | None) -> bool | None:
    if tried.outcome == PickOutcome.PICKED:
        return in_tray
    place = np.array([tried.x, tried.y, tried.z]) if looked is None else looked
    near = _nearest(place, fasteners, LOOKED if looked is None else SEEN)
    if tried.outcome == PickOutcome.NOTHING_THERE:
        return near is None
    if tried.outcome in (PickOutcome.TIGHT, PickOutcome.JAMMED):
        return near is not None and near.loose == (tried.outcome == PickOutcome.JAMMED)
    if tried.outcome == PickOutcome.OUT_OF_REACH and near is not None:
        return not load_map().serves(tried.side, near.in_base)
    return None


def _nearest(place: Array, fasteners: Sequence[Fastener], within: float) -> Fastener | None:
    """Return the fastener nearest to a place, across, or None if none is `within` [m]."""
    away = [float(np.hypot(f.position[0] - place[0], f.position[1] - place[1])) for f in fasteners]
    return None if not away or min(away) > within else fasteners[int(np.argmin(away))]
