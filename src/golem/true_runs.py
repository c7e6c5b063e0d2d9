"""Runs of true values: where a row of flags holds without a break."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def true_runs(flags: ArrayLike) -> NDArray[np.intp]:
    """Return (k, 2) where each run of true `flags` (n,) begins, and where it has ended, in order."""
    padded = np.concatenate([[False], np.asarray(flags, dtype=bool), [False]])
    return np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2)
