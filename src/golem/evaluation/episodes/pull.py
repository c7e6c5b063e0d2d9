"""How straight a hand really pulled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from golem.types import Array

LENGTH = 0.06
"""What is judged of a pull [m]: longer than any screw."""


def straightness(poses: Sequence[Array]) -> tuple[float, float] | None:
    """Return how far a hand was beside its line and how far it turned, at most, over the first 60 mm of a pull.

    Args:
        poses: (4, 4) each, of the grasp frame in the order of time. The line is the approach axis of the first.

    Returns:
        Distance [m] and angle [rad]; None where the hand did not move by a millimetre.
    """
    if not poses:
        return None
    T = np.array(poses)
    axis = T[0, :3, 2]
    gone = T[:, :3, 3] - T[0, :3, 3]
    back = -gone @ axis
    within = (np.maximum.accumulate(back) <= LENGTH) & (back >= 0.0)
    if not within.any() or back[within].max() < 0.001:
        return None
    beside = np.linalg.norm(gone + back[:, None] * axis, axis=1)
    turned = np.arccos(np.clip(T[:, :3, 2] @ axis, -1.0, 1.0))
    return float(beside[within].max()), float(turned[within].max())
