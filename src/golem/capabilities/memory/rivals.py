"""Objects of two kinds at one place: which of them was a misnamed look at the other?"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.memory.object_records import (
    EVIDENCE,
    FIRST,
    GONE,
    LAST,
    LOOKS,
    PLACE,
    SIZE,
    VARIANCE,
    ObjectRecords,
)
from golem.capabilities.memory.object_update import LARGEST
from golem.types import Array


def outvoted(records: ObjectRecords, row: int, gate: float, tie: float) -> bool:
    """Return whether the object of a row is rather another kind's, at whose place it is.

    Two bodies cannot be in one place: a detector that names them by turns has one of them before it. It is of the kind
    for which there is more evidence; where there is as much for both, both are answered.

    Args:
        records: all objects.
        row: of the one in question.
        gate: within how many standard deviations two places are one.
        tie: difference of log odds up to which there is as much evidence for both.
    """
    values = records.values
    rivals = _rivals(records, row, gate)
    return len(rivals) > 0 and bool(np.any(values[rivals, EVIDENCE] > values[row, EVIDENCE] + tie))


def _rivals(records: ObjectRecords, row: int, gate: float) -> NDArray[np.intp]:
    """Return the rows of what may be the same body under another name.

    Their lives overlap, and so does the time in which they were seen, unless this one was seen once only: what was
    seen several times after the other, and the other no more, has taken its place. What was found in the newest look
    at both are two bodies.
    """
    values, mine = records.values, records.values[row]
    # What may be anywhere, by its variance, is no rival of what is known to be here: the smaller variance counts.
    most = LARGEST + gate * math.sqrt(2.0 * mine[VARIANCE])
    near = np.flatnonzero(np.abs(values[:, 0] - mine[0]) <= most)  # most are far off along one axis already
    near = near[np.abs(values[near, 1] - mine[1]) <= most]
    if len(near) == 1:  # itself
        return near[:0]
    others, label = values[near], records.label(row)
    sigma = np.sqrt(2.0 * np.minimum(others[:, VARIANCE], mine[VARIANCE]))
    reach = np.maximum(others[:, SIZE], mine[SIZE]) + gate * sigma
    same_place = np.linalg.norm(others[:, PLACE] - mine[PLACE], axis=1) <= reach
    alive_together = _overlap(others, mine, GONE)
    seen_by_turns = _overlap(others, mine, LAST) if mine[LOOKS] > 1.0 else alive_together
    together = others[:, LAST] == mine[LAST]
    chosen = near[same_place & alive_together & seen_by_turns & ~together]
    return np.array([k for k in chosen if records.label(k) != label], np.intp)


def _overlap(others: Array, mine: Array, end: int) -> NDArray[np.bool_]:
    """Return which of the spans of time from the first look to the column `end` have some in common with one."""
    return (others[:, FIRST] <= mine[end]) & (mine[FIRST] <= others[:, end])
