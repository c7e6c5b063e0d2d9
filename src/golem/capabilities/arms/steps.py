"""Small steps of palm targets, by whoever moves them with rates."""

from __future__ import annotations

import numpy as np

from golem.types import Array


def led(goal: Array, pose: Array, step: Array, lead: float) -> Array:
    """Return `goal` (4, 4), moved by `step` (3,), no further from `pose` than `lead` [m], its rotation made one."""
    ahead = goal[:3, 3] + step - pose[:3, 3]
    u, _, v = np.linalg.svd(goal[:3, :3])
    out = np.eye(4)
    out[:3, :3] = u @ v
    out[:3, 3] = pose[:3, 3] + ahead * min(1.0, lead / max(float(np.linalg.norm(ahead)), 1e-9))
    return out
