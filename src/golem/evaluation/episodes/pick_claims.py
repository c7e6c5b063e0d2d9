"""Whether what a pick says of screws and work place is so."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from golem.capabilities.arms.reach_map import load_map
from golem.skills.pick_report import PickOutcome, PickReport, Tried
from golem.types import SIDES, Array

SEEN = 0.025
"""A screw this near to where the palm camera saw one is that one [m]: a quarter of their pitch."""
LOOKED = 0.08
"""The same for the head camera, which is off by 5 cm and more in the profile `field` [m]."""


@dataclass(frozen=True, slots=True)
class Fastener:
    """One that was in its place when the pick began.

    Attributes:
        position: (3,) of its bore's mouth in odom [m].
        in_base: (3,) the same in base_link [m].
        loose: whether it was loosened.
    """

    position: Array
    in_base: Array
    loose: bool


def claims(report: PickReport, fasteners: Sequence[Fastener], in_tray: bool) -> dict[str, float]:
    """Return for each outcome that was claimed, as `claim_NAME`, which share of its claims is right.

    `blocked`, `failed` and `slipped` claim nothing that is judged here.

    Args:
        report: what the pick says.
        fasteners: the truth at the beginning.
        in_tray: whether a screw is in the tray at the end.
    """
    judged: dict[str, list[float]] = defaultdict(list)
    if not report.tried:
        right = _whole(report.outcome, fasteners)
        if right is not None:
            judged[report.outcome].append(float(right))
    for tried in report.tried:
        right = _one(tried, fasteners, in_tray)
        if right is not None:
            judged[tried.outcome].append(float(right))
    return {f"claim_{name}": float(np.mean(values)) for name, values in judged.items()}


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


def _one(tried: Tried, fasteners: Sequence[Fastener], in_tray: bool) -> bool | None:
    """Return whether a claim about one screw is right."""
    if tried.outcome == PickOutcome.PICKED:
        return in_tray
    wide = tried.outcome == PickOutcome.OUT_OF_REACH
    near = _nearest(tried, fasteners, LOOKED if wide else SEEN)
    if tried.outcome == PickOutcome.NOTHING_THERE:
        return near is None
    if near is None:
        return None if tried.outcome not in (PickOutcome.TIGHT, PickOutcome.JAMMED) else False
    if wide:
        return not load_map().serves(tried.side, near.in_base)
    if tried.outcome in (PickOutcome.TIGHT, PickOutcome.JAMMED):
        return near.loose == (tried.outcome == PickOutcome.JAMMED)
    return None


def _nearest(tried: Tried, fasteners: Sequence[Fastener], within: float) -> Fastener | None:
    """Return the fastener nearest to where one was tried, across, or None if none is `within` [m]."""
    away = [float(np.hypot(f.position[0] - tried.x, f.position[1] - tried.y)) for f in fasteners]
    if not away or min(away) > within:
        return None
    return fasteners[int(np.argmin(away))]
