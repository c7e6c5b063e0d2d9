"""What one detection changes of an object that is remembered."""

from __future__ import annotations

import math

import numpy as np

from golem.capabilities.memory.object_records import BELIEF, EVIDENCE, LAST, LOOKS, PLACE, VARIANCE
from golem.types import Array, LocalizedObject

LEAST = 0.15
"""Log odds of a detection that is as likely wrong as right, by its score: what is found again and again is there."""
LARGEST = 0.3
"""Largest radius that an object is taken to have [m]."""


def update(row: Array, place: Array, variance: float, gain: float, ceiling: float, t: float) -> None:
    """Put a look at `place` to an object, whose row is changed.

    The variance does not fall below a quarter of the look's: the errors of poses are those of a drift, and do not
    average out.
    """
    fused = 1.0 / (1.0 / row[VARIANCE] + 1.0 / variance)
    row[PLACE] += fused / variance * (place - row[PLACE])
    row[VARIANCE] = max(fused, variance / 4.0)
    row[BELIEF] = min(row[BELIEF] + gain, ceiling)
    row[EVIDENCE] += gain
    row[LAST] = t
    row[LOOKS] += 1.0


def gain_of(score: float, most: float) -> float:
    """Return the log odds that a detection with this score is right, from `LEAST` to `most`."""
    share = min(max(score, 0.5), 0.999)
    return min(max(math.log(share / (1.0 - share)), LEAST), most)


def size_of(found: LocalizedObject) -> float:
    """Return the radius of an object [m], by the spread of its points."""
    if len(found.points) < 4:
        return 0.03
    spread = np.median(np.linalg.norm(found.points - np.median(found.points, axis=0), axis=1))
    return float(np.clip(1.5 * spread, 0.02, LARGEST))
