"""What a timed trajectory is between its points."""

from __future__ import annotations

import numpy as np

from golem.types import Array


def interpolate(times: Array, points: Array, velocities: Array | None, s: Array) -> Array:
    """Return (m, n) the joints of a trajectory at `s` (m,) [s]: cubic Hermite, or straight without velocities.

    Args:
        times: (k,) of its points, increasing.
        points: (k, n).
        velocities: (k, n), or None.
        s: when; before the first point it is that point, and after the last one that one.
    """
    if len(times) == 1:
        return np.repeat(points, len(s), axis=0)
    s = np.clip(s, times[0], times[-1])
    i = np.clip(np.searchsorted(times, s, side="right") - 1, 0, len(times) - 2)
    span = (times[i + 1] - times[i])[:, None]
    u = (s - times[i])[:, None] / span
    a, b = points[i], points[i + 1]
    if velocities is None:
        return a + u * (b - a)
    va, vb = span * velocities[i], span * velocities[i + 1]
    return a + u * va + u**2 * (3.0 * (b - a) - 2.0 * va - vb) + u**3 * (2.0 * (a - b) + va + vb)
